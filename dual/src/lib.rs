//! Rays that know what their neighbours see.
//!
//! Ray-object intersection, reflection and refraction, written once and generic over [`num_dual`]'s dual numbers (`f32` or
//! `f64`; value, first order in any number of parameters, second order), and **margins**: polynomials in the ray's direction that vanish
//! exactly on an edge, so that one ray can tell whether *anything* changes inside its footprint (a pixel, a light seen from a
//! point, a cell of a light's emission).
//!
//! ```
//! use dualux_dual::{Family, Sphere, bounds, margins, vec3, Jet, num_dual::Dual2SVec64};
//!
//! // A pixel: directions (0, 0, 1) + p0 (0.1, 0, 0) + p1 (0, 0.1, 0), p in [-1, 1]^2.
//! let pixel = Family::fixed(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 1.0), [vec3(0.1, 0.0, 0.0), vec3(0.0, 0.1, 0.0)]);
//! // The centre ray passes a small sphere; the pixel does not.
//! let ball = Sphere::new(vec3(0.3, 0.0, 5.0), 0.1);
//! let ray = pixel.fixed_ray::<Dual2SVec64<2>>();
//! assert!(ball.hit(&ray, 0.0, 1e9).is_none());
//! // The margin is a polynomial of degree 2, so its second-order expansion is exact, and `bounds` misses nothing.
//! let m = margins::sphere(&ray, &ball).expansion();
//! assert!(bounds(&m));
//! assert!((m.at([0.5, -0.2]) - margins::sphere(&pixel.at([0.5, -0.2]), &ball)).abs() < 1e-15);
//! ```
//!
//! # Parts
//!
//! * [`real`]: number types; [`Jet`] seeds and reads derivatives. [`Vec3`], [`Ray`], [`Family`].
//! * [`shapes`]: sphere, triangle, plane, rectangle, disk, open cylinder.
//! * [`optics`]: reflection, refraction with total internal reflection, interpolated normals.
//! * [`margins`]: one function per kind of edge, with its degree and the order at which it is exact.
//! * [`footprint`]: the tests [`corners`] (the source paper's neighbours) and [`bounds`].
//! * [`testkit`]: scenes of a few shapes, a detector and a brute-force oracle, to test your own shape or edge case in ten lines.
//!
//! # Conventions
//!
//! Directions are not normalised. A footprint is `[-1,1]`^N, so derivatives are by half its width. Dual and plain instances
//! give the same values to the last bit. No function panics on any finite or non-finite input; where a derivative does not exist
//! (a grazing ray) tests answer "edge", never "clear".
//!
//! # Source
//!
//! T. Namae, M. Makino: *An Adaptive and Efficient Photon Mapping by Automatic Differentiation*, after Makino's work on edge detection
//! by automatic differentiation. Margins, chords and bounds in place of predicted hits are this project's. H. Igehy: *Tracing Ray
//! Differentials* (1999) for transfer, reflection and refraction.

// `!(a > b)` is written on purpose where NaN must take the careful branch.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod footprint;
pub mod margins;
pub mod optics;
pub mod ray;
pub mod real;
pub mod shapes;
pub mod testkit;
pub mod vec3;

pub use footprint::{Expansion, Guarded, Neighbours, Test, bounds, corners, corners_inside, range};
pub use num_dual;
pub use optics::{Refraction, face_against, interpolate, interpolate_normal, interpolate_vec3, reflect, refract};
pub use ray::{Family, Ray};
pub use real::{Jet, Prim, Real, Scalar, constant};
pub use shapes::{Cylinder, Disk, Plane, Rectangle, Root, Sphere, Triangle};
pub use vec3::{Vec3, vec3};
