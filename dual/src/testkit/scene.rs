//! Scenes of a few shapes, built-in or own.

use super::features::{Feature, Kind, Surface, View};
use crate::margins;
use crate::ray::Ray;
use crate::shapes::{Cylinder, Disk, Rectangle, Root, Sphere, Triangle};
use crate::vec3::Vec3;

/// Where a ray meets a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter.
    pub t: f64,
    /// Which part of the shape; two rays that see different parts see an edge between them.
    pub part: u32,
}

/// A shape under test.
pub trait Shape {
    /// Nearest intersection with t in (t_min, t_max).
    fn hit(&self, ray: &Ray<f64>, t_min: f64, t_max: f64) -> Option<Hit>;

    /// All edges that may be seen from the view's origin(s).
    fn features(&self, view: &View) -> Vec<Feature>;

    /// For depth swaps; unknown by default.
    fn surface(&self) -> Surface {
        Surface::Unknown
    }

    /// True only if the set of its points is convex or, for a closed surface, bounds a convex body: then it hides every point of a
    /// segment (or convex flat piece) whose ends it hides.
    fn is_convex(&self) -> bool {
        false
    }
}

/// Shapes, in the order they were added.
#[derive(Default)]
pub struct Scene {
    pub(super) shapes: Vec<Box<dyn Shape>>,
}

impl Scene {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a shape; its index is the number of shapes before it.
    pub fn with(mut self, shape: impl Shape + 'static) -> Self {
        self.shapes.push(Box::new(shape));
        self
    }

    /// Nearest hit: index of the shape, and where.
    pub fn hit(&self, ray: &Ray<f64>, t_max: f64, exclude: Option<usize>) -> Option<(usize, Hit)> {
        let mut best: Option<(usize, Hit)> = None;
        for (i, shape) in self.shapes.iter().enumerate() {
            let limit = best.map_or(t_max, |(_, h)| h.t);
            if Some(i) != exclude
                && let Some(hit) = shape.hit(ray, 0.0, limit)
            {
                best = Some((i, hit));
            }
        }
        best
    }
}

fn boundary(edges: &[[Vec3<f64>; 2]]) -> Vec<Feature> {
    edges.iter().map(|e| Feature::segment(Kind::Boundary, *e)).collect()
}

impl Shape for Triangle<f64> {
    fn hit(&self, ray: &Ray<f64>, t_min: f64, t_max: f64) -> Option<Hit> {
        Triangle::hit(self, ray, t_min, t_max).map(|t| Hit { t, part: 0 })
    }
    fn features(&self, _: &View) -> Vec<Feature> {
        boundary(&self.edges())
    }
    fn surface(&self) -> Surface {
        Surface::Polygon(vec![self.a, self.b, self.c])
    }
    fn is_convex(&self) -> bool {
        true
    }
}

impl Shape for Rectangle<f64> {
    fn hit(&self, ray: &Ray<f64>, t_min: f64, t_max: f64) -> Option<Hit> {
        Rectangle::hit(self, ray, t_min, t_max).map(|t| Hit { t, part: 0 })
    }
    fn features(&self, _: &View) -> Vec<Feature> {
        boundary(&self.edges())
    }
    fn surface(&self) -> Surface {
        Surface::Polygon(self.corners().to_vec())
    }
    fn is_convex(&self) -> bool {
        true
    }
}

impl Shape for Disk<f64> {
    fn hit(&self, ray: &Ray<f64>, t_min: f64, t_max: f64) -> Option<Hit> {
        Disk::hit(self, ray, t_min, t_max).map(|t| Hit { t, part: 0 })
    }
    fn features(&self, _: &View) -> Vec<Feature> {
        vec![Feature::circle(Kind::Boundary, *self)]
    }
    fn surface(&self) -> Surface {
        Surface::Disk(*self)
    }
    fn is_convex(&self) -> bool {
        true
    }
}

impl Shape for Sphere<f64> {
    fn hit(&self, ray: &Ray<f64>, t_min: f64, t_max: f64) -> Option<Hit> {
        Sphere::hit(self, ray, t_min, t_max).map(|(t, _)| Hit { t, part: 0 })
    }
    fn features(&self, view: &View) -> Vec<Feature> {
        // From inside there is no silhouette; a moving origin is taken at its centre.
        let Some(circle) = margins::sphere_silhouette(view.family.o, self) else {
            return vec![];
        };
        let s = *self;
        let silhouette =
            Feature::margin(Kind::Silhouette, move |r| (margins::sphere(r, &s), margins::sphere_guard(r, &s)));
        vec![silhouette.in_plane(circle.plane())]
    }
    fn surface(&self) -> Surface {
        Surface::Sphere(*self)
    }
    fn is_convex(&self) -> bool {
        true
    }
}

impl Shape for Cylinder<f64> {
    /// Part 0 is the outer wall, 1 the inner.
    fn hit(&self, ray: &Ray<f64>, t_min: f64, t_max: f64) -> Option<Hit> {
        let (t, root) = Cylinder::hit(self, ray, t_min, t_max)?;
        Some(Hit { t, part: u32::from(root == Root::Far) })
    }
    fn features(&self, view: &View) -> Vec<Feature> {
        let mut out: Vec<_> = self.caps().map(|cap| Feature::circle(Kind::Boundary, cap)).into();
        if view.family.has_fixed_origin() {
            let lines = margins::cylinder_silhouette(view.family.o, self);
            out.extend(lines.into_iter().flatten().map(|s| Feature::segment(Kind::Silhouette, s)));
        } else if self.is_outside(view.family.o) {
            let c = *self;
            out.push(Feature::margin(Kind::Silhouette, move |r| (margins::cylinder(r, &c), crate::constant(1.0))));
        }
        out
    }
}
