//! Test kit: does a detector built from these margins see what real rays see?
//!
//! Put a few shapes into a [`Scene`], take a [`Family`](crate::Family), and compare what the margins *predict* from the centre ray alone with
//! what a brute-force [oracle](Scene::oracle), n x n real rays through the footprint, *finds*. Meant for a handful of shapes:
//! there is no acceleration structure, and own shapes are trait objects.
//!
//! An edge case in ten lines:
//!
//! ```
//! use dualux_dual::testkit::{Kind, Scene};
//! use dualux_dual::{Family, Rectangle, Sphere, vec3};
//!
//! let scene = Scene::new()
//!     .with(Sphere::new(vec3(0.02, 0.0, 3.0), 0.01)) // tiny: the centre ray misses it
//!     .with(Rectangle::new(vec3(0.0, 0.0, 5.0), vec3(9.0, 0.0, 0.0), vec3(0.0, 9.0, 0.0)));
//! let pixel = Family::fixed(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0), [vec3(0.02, 0.0, 0.0), vec3(0.0, 0.02, 0.0)]);
//! scene.expect(&pixel.into(), &[Kind::Silhouette]); // panics with a report if margins or oracle disagree
//! scene.expect(&pixel.cell([-0.5, 0.0], [0.5, 1.0]).into(), &[]);
//! ```
//!
//! Your own shape: say how it is hit, and give its margin, written once for all number types.
//!
//! ```
//! use dualux_dual::testkit::{Feature, Hit, Kind, Rng, Scene, Shape, View};
//! use dualux_dual::{Ray, Real, Test, vec3};
//!
//! /// The ellipsoid x^2 + y^2 + 4 z^2 = 1.
//! struct Ellipsoid;
//! /// Coefficients of a t^2 - 2 b t + c = 0, and the discriminant b^2 - a c, of degree 2 in d.
//! fn quadratic<T: Real<Primitive = f64>>(r: &Ray<T>) -> (T, T, T) {
//!     let form = |u: dualux_dual::Vec3<T>, v: dualux_dual::Vec3<T>| u.x * v.x + u.y * v.y + u.z * v.z * 4.0;
//!     let (a, b) = (form(r.d, r.d), -form(r.o, r.d));
//!     (a, b, b * b - a * (form(r.o, r.o) - 1.0))
//! }
//! impl Shape for Ellipsoid {
//!     fn hit(&self, ray: &Ray<f64>, t_min: f64, t_max: f64) -> Option<Hit> {
//!         let (a, b, disc) = quadratic(ray);
//!         let t = (b - disc.sqrt()) / a; // NaN where it misses
//!         (t > t_min && t < t_max).then_some(Hit { t, part: 0 })
//!     }
//!     fn features(&self, _: &View) -> Vec<Feature> {
//!         // The margin, and a guard: positive in front.
//!         vec![Feature::margin(Kind::Silhouette, |ray| { let (_, b, disc) = quadratic(ray); (disc, b) })]
//!     }
//! }
//! let scene = Scene::new().with(Ellipsoid);
//! let mut rng = Rng::new(1);
//! let views: Vec<_> = (0..1000).map(|_| {
//!     let o = vec3(0.0, 0.0, -4.0) + rng.cube(1.0);
//!     let aim = rng.cube(1.5) - o;
//!     rng.family(o, aim, 0.05).into()
//! }).collect();
//! let score = scene.score(&views, Test::Bounds, 2, 8);
//! assert_eq!(score.recall(), 1.0, "{score}");
//! ```
//!
//! **What counts.** The oracle calls a footprint an edge if two of its rays see different things: another shape, another part of a
//! shape (inner or outer wall of a cylinder), nothing, or, if asked, a ray below the horizon. With finite n it misses what is thinner
//! than its grid, so measured *precision* is a lower bound while *recall* 1 is a real demand.
//!
//! **Not handled.** Depth swaps with a cylinder or an own shape (only polygons, disks and spheres among themselves); hiding by
//! several shapes together (an edge is dropped only if one convex shape hides all of it); alpha; more than 2 parameters.

mod detect;
mod features;
mod oracle;
mod rng;
mod scene;
mod score;

pub use detect::Event;
pub use features::{Edge, Feature, Kind, Surface, View};
pub use oracle::{Label, Truth};
pub use rng::Rng;
pub use scene::{Hit, Scene, Shape};
pub use score::Score;

#[cfg(test)]
mod tests;
