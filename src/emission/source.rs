//! One light as a map from primary-sample space to rays.
//!
//! ```text
//! numbers (u0, u1) -> where on the light, (v0, v1) -> where to
//! flux of the photon at (u, v), if it were the only one = value(u, v) / pdf(v)
//! ```
//!
//! | light | position | direction | measure of `pdf` | value |
//! | --- | --- | --- | --- | --- |
//! | rectangle, disk, triangle, cylinder | uniform by area | round the normal there | solid angle x cos | radiance x area |
//! | sphere | disk across the direction | all directions | solid angle | radiance x pi R^2 |
//! | constant, envmap | disk across the direction round the scene | all directions, in proportion to the map | solid angle | radiance x pi R^2 |
//! | directional | disk across the direction round the scene | one | none: 1 | irradiance x pi R^2 |
//! | point, spot | one | all directions, in proportion to the spot's profile | solid angle | intensity |
//!
//! value / pdf is constant, the light's power, but for textures and maps. A sphere is emission of parallel beams: phase-space volume is
//! the same ( dA cos dw = dA' dw, dA' across the direction), and directions do not depend on where the ray starts, so that
//! they can be cut into cells.
//! Source: METHODS 6.2; the beams of a sphere are folklore (e.g. Veach 1997, section 3.6, on ray measures). Bias: none.
//! Not handled: importance inside the triangles of textured meshes (their flux then varies with the texture).
//! Verified by `tests/maps.rs` (derivatives, inverses) and `tests/flux.rs` (radiometry, chi-square).

use super::area::Lamp;
use super::delta::Delta;
use super::environment::{Ball, Infinity};
use super::warp::{self, Mapped};
use super::{MOST_PARAMETERS, Spread};
use crate::math::{DVec3, Rgb, Vec3};
use crate::scene::light::{DeltaLight, LightKind};
use crate::scene::{Geometry, Scene};
use std::f64::consts::{PI, TAU};

/// Longest derivative of a unit direction over half a cell: beyond it a linear extension means nothing.
const LONGEST: f64 = 1.0;

/// A light of a scene.
#[derive(Clone, Debug)]
pub struct Source<'a> {
    /// Index into `Lights::infos`.
    pub light: u32,
    pub(super) kind: Kind<'a>,
}

#[derive(Clone, Debug)]
pub(super) enum Kind<'a> {
    Lamp(Lamp<'a>),
    Ball(Ball<'a>),
    Infinity(Infinity<'a>),
    Delta(Delta<'a>),
}

/// A direction drawn with a density, in the light's own frame there (lamps: +z is the normal).
#[derive(Clone, Copy, Debug)]
pub struct Drawn {
    /// Unit direction and derivatives by the two numbers.
    pub w: Mapped<DVec3>,
    /// 1 / density in the measure of the table above.
    pub per_pdf: f64,
}

/// A ray of a light and what the numbers do to it.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Origin, robust for tracing.
    pub o: Vec3,
    /// Unit direction.
    pub d: DVec3,
    /// Flux per measure of positions (the unit square) and of directions (see the table).
    pub value: Rgb,
    /// Derivatives of the origin by u0, u1, v0, v1.
    pub o_u: [DVec3; MOST_PARAMETERS],
    /// Derivatives of the direction.
    pub d_u: [DVec3; MOST_PARAMETERS],
}

impl Start {
    /// The neighbourhood of half widths `half` in the numbers.
    pub fn spread(&self, half: [f64; MOST_PARAMETERS]) -> Spread {
        let o = std::array::from_fn(|k| (self.o_u[k] * half[k]).as_vec3());
        let d = std::array::from_fn(|k| (self.d_u[k] * half[k]).clamp_length_max(LONGEST).as_vec3());
        Spread { o, d }
    }
}

impl<'a> Source<'a> {
    /// Light number `light` of a scene.
    pub fn new(scene: &'a Scene, light: u32) -> Self {
        let kind = match scene.lights.kind(light as usize) {
            LightKind::Lamp(shape) => match &scene.shapes[shape as usize].geometry {
                Geometry::Sphere(sphere) => Kind::Ball(Ball::new(scene, shape, sphere)),
                _ => Kind::Lamp(Lamp::new(scene, shape)),
            },
            LightKind::Delta(delta) => Kind::Delta(Delta::new(scene, delta)),
            LightKind::Environment(environment) => Kind::Infinity(Infinity::new(scene, environment)),
        };
        Source { light, kind }
    }

    /// All lights of a scene, in the order of `Lights::infos`.
    pub fn all(scene: &'a Scene) -> Vec<Self> {
        (0..scene.lights.infos.len() as u32).map(|light| Source::new(scene, light)).collect()
    }

    /// Keeps, of a light at infinity, only rays that meet the sphere. They start outside of the scene all the same.
    pub(super) fn narrow(&mut self, sphere: (DVec3, f64)) {
        let (centre, radius, away) = match &mut self.kind {
            Kind::Infinity(i) => (&mut i.centre, &mut i.radius, &mut i.away),
            Kind::Delta(d) => (&mut d.centre, &mut d.radius, &mut d.away),
            Kind::Lamp(_) | Kind::Ball(_) => return,
        };
        if sphere.1 < *radius {
            *away += sphere.0.distance(*centre);
            (*centre, *radius) = sphere;
        }
    }

    /// Whether the two numbers of the position matter.
    pub fn has_position(&self) -> bool {
        !matches!(&self.kind, Kind::Delta(d) if !matches!(d.light, DeltaLight::Directional { .. }))
    }

    /// Whether the two numbers of the direction matter.
    pub fn has_direction(&self) -> bool {
        !matches!(&self.kind, Kind::Delta(d) if matches!(d.light, DeltaLight::Directional { .. }))
    }

    /// Whether numbers pass through a table: the map has steps in its derivatives.
    pub fn is_tabulated(&self) -> bool {
        match &self.kind {
            Kind::Lamp(lamp) => lamp.is_tabulated(),
            Kind::Infinity(infinity) => infinity.is_tabulated(),
            Kind::Ball(_) | Kind::Delta(_) => false,
        }
    }

    /// What positions cover, world units squared: the lamp's area, or the disk's; 0 for a point.
    pub fn area(&self) -> f64 {
        match &self.kind {
            Kind::Lamp(lamp) => lamp.area(),
            Kind::Ball(ball) => PI * ball.radius * ball.radius,
            Kind::Infinity(infinity) => PI * infinity.radius * infinity.radius,
            Kind::Delta(d) if self.has_position() => PI * d.radius * d.radius,
            Kind::Delta(_) => 0.0,
        }
    }

    /// The measure of all directions, see the table.
    pub fn directions(&self) -> f64 {
        match &self.kind {
            Kind::Lamp(_) => PI,
            Kind::Ball(_) | Kind::Infinity(_) => 2.0 * TAU,
            Kind::Delta(d) => d.solid_angle(),
        }
    }

    /// Draws a direction in proportion to flux: the natural density.
    pub fn direction(&self, v: [f64; 2]) -> Drawn {
        match &self.kind {
            Kind::Lamp(_) => Drawn { w: warp::hemisphere(v), per_pdf: PI },
            Kind::Ball(_) => Drawn { w: warp::sphere(v), per_pdf: 2.0 * TAU },
            Kind::Infinity(infinity) => infinity.direction(v),
            Kind::Delta(delta) => delta.direction(v),
        }
    }

    /// The ray from position number `u` in the direction drawn. `None` where nothing is emitted.
    pub fn start(&self, u: [f64; 2], drawn: &Drawn) -> Option<Start> {
        let start = match &self.kind {
            Kind::Lamp(lamp) => lamp.start(u, drawn),
            Kind::Ball(ball) => ball.start(u, drawn),
            Kind::Infinity(infinity) => infinity.start(u, drawn),
            Kind::Delta(delta) => delta.start(u, drawn),
        };
        let sound = start.value.is_finite() && start.value != Rgb::ZERO && start.o.is_finite() && start.d.is_finite();
        sound.then_some(start)
    }

    /// Area of a lamp's surface, world units squared; 0 for others.
    pub fn surface_area(&self) -> f64 {
        match &self.kind {
            Kind::Lamp(lamp) => lamp.area(),
            Kind::Ball(ball) => 4.0 * PI * ball.radius * ball.radius,
            Kind::Infinity(_) | Kind::Delta(_) => 0.0,
        }
    }

    /// The point of a lamp's surface for the numbers `u`, uniform by area (textured lamps: by their table): it, the unit normal on the side that
    /// emits, and radiance over the density per area, W/sr along the normal. `None` for other lights and where nothing is emitted.
    pub fn surface_point(&self, u: [f64; 2]) -> Option<(Vec3, Vec3, Rgb)> {
        let (u, drawn, scale) = match &self.kind {
            Kind::Lamp(_) => {
                let along = Mapped { at: DVec3::Z, by: [DVec3::ZERO; 2] };
                (u, Drawn { w: along, per_pdf: PI }, 1.0)
            }
            // Beams through the middle of the disk across them leave along the normal.
            Kind::Ball(_) => ([0.5; 2], Drawn { w: warp::sphere(u), per_pdf: 2.0 * TAU }, 4.0),
            Kind::Infinity(_) | Kind::Delta(_) => return None,
        };
        let start = self.start(u, &drawn)?;
        Some((start.o, start.d.as_vec3(), start.value * scale))
    }

    /// The natural ray for numbers u0, u1, v0, v1 in [0, 1), and the flux that it carries if it is the only one.
    pub fn emit(&self, u: [f64; MOST_PARAMETERS]) -> Option<(Start, Rgb)> {
        let drawn = self.direction([u[2], u[3]]);
        let start = self.start([u[0], u[1]], &drawn)?;
        Some((start, start.value * drawn.per_pdf as f32))
    }

    /// The numbers that [`Self::emit`] turns into the ray through `o` along the unit vector `d`; numbers that do not matter are 1/2.
    /// `None` if it is no ray of this light. `o` may lie anywhere on the ray but for lamps, where it must be near to the surface.
    pub fn invert(&self, o: DVec3, d: DVec3) -> Option<[f64; MOST_PARAMETERS]> {
        match &self.kind {
            Kind::Lamp(lamp) => lamp.invert(o, d),
            Kind::Ball(ball) => ball.invert(o, d),
            Kind::Infinity(infinity) => infinity.invert(o, d),
            Kind::Delta(delta) => delta.invert(o, d),
        }
    }
}
