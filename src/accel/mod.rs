//! Ray queries over the shapes of a scene: an 8-wide bounding volume hierarchy.
//!
//! * `layout`: the arrays that hold the tree; other walks (widened rays, footprints) read the same ones
//! * `build`, `plan`, `collapse`: shapes to primitives, binary tree by obvhs, nodes of eight children
//! * `pages`: memory for the arrays
//! * `traverse`: nearest hit and occlusion, written once over a small `Kernel`
//! * `portable`, `avx2`: the two kernels; every value they compute is equal bit for bit
//! * `quadric`: spheres, disks and cylinders
//! * [`footprint`]: the walk with a beam, for the edge detector
//!
//! Precision: triangles are tested watertight (Woop et al. 2013): neighbours never leave a gap at the edge or vertex they
//! share. Boxes are conservative. No constant here has a unit of length, so that scenes of any scale behave alike.
//! A query is deterministic: hits at equal t are decided by the lower (shape, prim).
//!
//! Not handled: coordinates beyond 1e12 (such primitives are left out, as are those with NaN, infinite or
//! degenerate geometry), direction components below 1e-38 (taken as zero), motion.

mod avx2;
mod build;
mod collapse;
pub mod footprint;
pub(crate) mod layout;
mod pages;
mod plan;
mod portable;
mod quadric;
mod traverse;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_robust;

use crate::math::Vec3;
use crate::scene::{Shape, SurfacePoint};
use avx2::Avx2;
use layout::Tree;

/// A ray segment: points o + t d with tmin <= t <= tmax. `d` need not be a unit vector; t is in units of |d|.
/// Rays that leave a surface: [`Ray::leaving`].
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin.
    pub o: Vec3,
    /// Direction.
    pub d: Vec3,
    /// Start, not negative (a negative one counts as 0); must be above 0 for rays that leave a surface.
    pub tmin: f32,
    /// End, may be infinite.
    pub tmax: f32,
}

impl Ray {
    /// The ray without end that leaves the surface point towards the unit vector `d`.
    pub fn leaving(at: &SurfacePoint, d: Vec3) -> Self {
        Ray { o: at.spawn_origin(d), d, tmin: f32::MIN_POSITIVE, tmax: f32::INFINITY }
    }
}

/// The nearest intersection of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter.
    pub t: f32,
    /// First surface coordinate (see `ShapeHit`).
    pub u: f32,
    /// Second surface coordinate.
    pub v: f32,
    /// Shape index.
    pub shape: u32,
    /// Triangle of a mesh, else 0.
    pub prim: u32,
}

/// Which instructions a query uses. The answers are the same, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simd {
    /// What every processor of the target has.
    Portable,
    /// 256-bit AVX2 where the processor has it, else as `Portable`.
    Avx2,
}

/// Acceleration structure over shapes. Rectangles lie in it as two triangles with their shape's id.
#[derive(Debug)]
pub struct Accel {
    tree: Tree,
    avx2: Option<Avx2>,
}

impl Accel {
    /// Builds the structure, on all threads of the current rayon pool.
    pub fn new(shapes: &[Shape]) -> Self {
        Self::with_simd(shapes, Simd::Avx2)
    }

    /// Builds the structure and chooses the instructions of its queries. The tree does not depend on them.
    pub fn with_simd(shapes: &[Shape], simd: Simd) -> Self {
        Accel { tree: build::build(shapes), avx2: if simd == Simd::Avx2 { Avx2::detect() } else { None } }
    }

    /// The instructions in use.
    pub fn simd(&self) -> Simd {
        match self.avx2 {
            Some(_) => Simd::Avx2,
            None => Simd::Portable,
        }
    }

    /// Nearest intersection. None as well for rays with a NaN or infinite component (`tmax` aside) or no direction.
    pub fn closest(&self, ray: &Ray) -> Option<Hit> {
        match self.avx2 {
            Some(avx2) => avx2.closest(&self.tree, ray),
            None => portable::closest(&self.tree, ray),
        }
    }

    /// Whether anything lies on the segment: true exactly where `closest` finds a hit.
    pub fn occluded(&self, ray: &Ray) -> bool {
        match self.avx2 {
            Some(avx2) => avx2.occluded(&self.tree, ray),
            None => portable::occluded(&self.tree, ray),
        }
    }
}
