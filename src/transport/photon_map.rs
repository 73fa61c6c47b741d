//! Photon maps: radiance and irradiance from the photons around a point.
//!
//! ```text
//! L(x, wo) = sum_i flux_i K_i(x) f(wo, wi_i) |cos_shade(wi_i)| / |cos_geo(wi_i)|
//! E(x)     = sum_i flux_i K_i(x) |cos_shade(wi_i)| / |cos_geo(wi_i)|                     so that Lambert's L = albedo / pi E
//! ```
//!
//! The quotient of cosines makes it the adjoint of what paths from the eye compute, shading normals included: those weigh incident light by
//! the shading cosine, photons land in proportion to the geometric one (Veach 1997, section 5.3). Lambertian surfaces take the quotient
//! at the photon, where it is exact on curved surfaces as well, others at x. `diffuse` is the diffuse part of a material ([`Bsdf::split`]).
//! Kernels: [`Kernel`]. Photons count whose surface faces the same way, within [`NORMAL_CONE`]: nothing leaks
//! through thin walls or round corners.
//! Source: Jensen 1996; Knaus & Zwicker 2011 for radii that shrink from pass to pass, r_{i+1}^2 = r_i^2 (i + alpha) / (i + 1), alpha = 2/3;
//! METHODS 3.B.
//! Bias: blur by the kernel (goes to zero with the radii), light lost at borders where [`border`] does not apply.
//! Not handled: participating media, surfaces without a diffuse part (nothing is stored there).
//! Verified by `tests/`: closed forms and a furnace; companions with wrong factors fail.

use super::nearest::NearestPhotons;
use super::obstacle::{Obstacle, Obstacles};
use super::photon::{Ledger, Photon, PhotonClass};
use super::photon_lanes::{Arrival, PhotonLanes, Query};
pub use super::photon_settings::{ALPHA, Kernel, PhotonSettings, SCALE, shrinkage};
use super::photon_tree::PhotonTree;
use super::photon_walk::{GRAZING, Goal, Traced, trace};
use super::{World, border};
use crate::emission::EmissionDensity;
use crate::math::{Rgb, Vec3};
use crate::scene::{Bsdf, SurfacePoint, Transport};
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Smallest cosine between the normals of a photon and of the point that asks: 60 degrees.
pub const NORMAL_CONE: f32 = 0.5;
/// Photons of one kind, ready to be asked.
#[derive(Debug)]
enum Estimator {
    Kernels(Box<Kernels>),
    Nearest(NearestPhotons),
}

/// Photons with their kernels.
#[derive(Debug)]
struct Kernels {
    tree: PhotonTree<Arrival>,
    lanes: PhotonLanes,
    /// Photons: the other kernels are their images.
    photons: usize,
    obstacles: Obstacles,
}

impl Estimator {
    fn new(world: World, photons: &[Photon], settings: &PhotonSettings, pass: u64) -> Self {
        let widths = settings.widths(world, photons.len(), pass);
        if let Kernel::Nearest { k } = settings.kernel {
            return Estimator::Nearest(NearestPhotons::build(photons, k, widths.max));
        }
        let mut ellipsoids: Vec<_> = photons.par_iter().map(|p| widths.ellipsoid(p)).collect();
        let (obstacles, obstacle) = Obstacles::find(world, photons, &ellipsoids);
        // Images come behind the photons, with the index of theirs.
        let mut images = Vec::new();
        if settings.fold {
            let of = |(i, photon)| {
                let obstacle = obstacles.get(obstacle[i]);
                border::images(world, photon, &ellipsoids[i], obstacle).into_iter().map(move |e| (i, e))
            };
            images = photons.par_iter().enumerate().flat_map_iter(of).collect();
        }
        ellipsoids.extend(images.iter().map(|(_, e)| *e));
        let arrival = |i: usize| {
            let of = if i < photons.len() { i } else { images[i - photons.len()].0 };
            let Photon { wi, n, flux, shading, segments, .. } = photons[of];
            let obstacle = obstacle[of];
            // An image's q says nothing of the way from the photon.
            let clear = obstacles.get(obstacle).filter(|_| of == i).map_or(0.0, Obstacle::clear);
            Arrival { power: flux * ellipsoids[i].peak(), wi, n, shading, segments, obstacle, clear }
        };
        let mut tree = PhotonTree::build(&ellipsoids, arrival);
        let obstacles = obstacles.that_hide(tree.items_mut().iter_mut().map(|a| &mut a.obstacle));
        Estimator::Kernels(Box::new(Kernels {
            lanes: PhotonLanes::new(&tree),
            tree,
            photons: photons.len(),
            obstacles,
        }))
    }

    fn len(&self) -> usize {
        match self {
            Estimator::Kernels(kernels) => kernels.photons,
            Estimator::Nearest(nearest) => nearest.len(),
        }
    }

    fn bytes(&self) -> usize {
        match self {
            Estimator::Kernels(k) => k.tree.bytes() + k.lanes.bytes() + k.obstacles.bytes(),
            Estimator::Nearest(nearest) => nearest.bytes(),
        }
    }

    /// Photons around `x` with what they add to the irradiance, W/m^2, those only whose surface faces as `n` does.
    #[inline]
    fn visit(&self, x: Vec3, n: Vec3, most: u32, mut visit: impl FnMut(&Arrival, Rgb)) {
        let mut counts = |a: &Arrival, weight: f32| {
            if a.n.dot(n) >= NORMAL_CONE && a.segments <= most {
                visit(a, a.power * weight);
            }
        };
        match self {
            Estimator::Kernels(k) => k.tree.visit(x, |a: &Arrival, weight| {
                if 1.0 - weight < a.clear || !k.obstacles.hides(a.obstacle, x) {
                    counts(a, weight);
                }
            }),
            Estimator::Nearest(nearest) => nearest.visit(x, &mut counts),
        }
    }

    fn radiance(&self, at: &SurfacePoint, diffuse: &Bsdf, wo: Vec3, most: u32) -> Rgb {
        let n = if wo.dot(at.n_geo) < 0.0 { -at.n_geo } else { at.n_geo };
        if let Some((_, albedo)) = diffuse.lambert(wo) {
            let dark = albedo == Rgb::ZERO;
            return if dark { Rgb::ZERO } else { self.irradiance(at.p, n, most) * albedo * FRAC_1_PI };
        }
        let mut sum = Rgb::ZERO;
        self.visit(at.p, n, most, |a, e| {
            sum += e * diffuse.eval(wo, a.wi, Transport::Radiance) / a.wi.dot(n).abs().max(GRAZING);
        });
        sum
    }

    /// Kernels that cover `p` and face as `n` does.
    fn found(&self, p: Vec3, n: Vec3) -> usize {
        let mut found = 0;
        self.visit(p, n, u32::MAX, |_, _| found += 1);
        found
    }

    /// Irradiance on the side of `n`.
    fn irradiance(&self, p: Vec3, n: Vec3, most: u32) -> Rgb {
        if let Estimator::Kernels(k) = self {
            return k.lanes.irradiance(&k.tree, &k.obstacles, &Query { x: p, n, most });
        }
        let mut sum = Rgb::ZERO;
        self.visit(p, n, most, |a, e| sum += e * a.shading);
        sum
    }
}

/// Photons that came by nearly specular scatterings only: caustics.
#[derive(Debug)]
pub struct CausticMap {
    photons: Estimator,
    /// What became of the light.
    pub ledger: Ledger,
}

impl CausticMap {
    /// Traces the photons of pass `pass` and sorts them. A pure function of its arguments.
    pub fn build(world: World, density: &dyn EmissionDensity, settings: &PhotonSettings, pass: u64) -> Self {
        let traced = trace(world, density, &settings.walk(Goal::Caustics), pass);
        Self::from_photons(world, traced, settings, pass)
    }

    /// From photons that are there already.
    pub fn from_photons(world: World, traced: Traced, settings: &PhotonSettings, pass: u64) -> Self {
        CausticMap { photons: Estimator::new(world, &traced.photons, settings, pass), ledger: traced.ledger }
    }

    /// Radiance towards `wo` by caustic light that `diffuse`, the diffuse part of the material at `at`, scatters.
    pub fn radiance(&self, at: &SurfacePoint, diffuse: &Bsdf, wo: Vec3) -> Rgb {
        self.radiance_within(at, diffuse, wo, u32::MAX)
    }

    /// The same by photons with `most_segments` segments at most.
    pub fn radiance_within(&self, at: &SurfacePoint, diffuse: &Bsdf, wo: Vec3, most_segments: u32) -> Rgb {
        self.photons.radiance(at, diffuse, wo, most_segments)
    }

    /// Irradiance by caustic light at `p`, on the side of the unit normal `n_geo`.
    pub fn irradiance(&self, p: Vec3, n_geo: Vec3) -> Rgb {
        self.irradiance_within(p, n_geo, u32::MAX)
    }

    /// The same by ways of `most` segments at most.
    pub fn irradiance_within(&self, p: Vec3, n_geo: Vec3, most: u32) -> Rgb {
        self.photons.irradiance(p, n_geo, most)
    }

    /// Photons that count at `p` on the side of `n_geo`.
    pub fn found(&self, p: Vec3, n_geo: Vec3) -> usize {
        self.photons.found(p, n_geo)
    }

    /// Whether no photon was stored.
    pub fn is_empty(&self) -> bool {
        self.stored() == 0
    }

    /// Number of photons stored.
    pub fn stored(&self) -> usize {
        self.photons.len()
    }

    /// Memory of the map, bytes.
    pub fn bytes(&self) -> usize {
        self.photons.bytes()
    }
}

/// Classes of photons that a query of a [`GlobalMap`] counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Filter {
    /// By class, [`PhotonClass::ALL`] in order.
    pub classes: [bool; 3],
    /// Longest way, segments.
    pub most_segments: u32,
}

impl Filter {
    /// Everything.
    pub const ALL: Filter = Filter { classes: [true; 3], most_segments: u32::MAX };
    /// All but what comes straight from lights.
    pub const WITHOUT_DIRECT: Filter = Filter { classes: [false, true, true], most_segments: u32::MAX };
    /// Light that was scattered diffusely before.
    pub const INDIRECT: Filter = Filter { classes: [false, false, true], most_segments: u32::MAX };

    /// The same for ways of `most_segments` segments at most.
    pub fn within(self, most_segments: u32) -> Self {
        Filter { most_segments, ..self }
    }
}

/// All light on surfaces with a diffuse part, class by class.
#[derive(Debug)]
pub struct GlobalMap {
    classes: [Option<Estimator>; 3],
    /// What became of the light.
    pub ledger: Ledger,
}

impl GlobalMap {
    /// Traces the photons of pass `pass` and sorts those of the classes that `keep` counts. A pure function of its arguments.
    pub fn build(
        world: World,
        density: &dyn EmissionDensity,
        settings: &PhotonSettings,
        pass: u64,
        keep: Filter,
    ) -> Self {
        let traced = trace(world, density, &settings.walk(Goal::Classes(keep.classes)), pass);
        Self::from_photons(world, traced, settings, pass)
    }

    /// From photons that are there already.
    pub fn from_photons(world: World, traced: Traced, settings: &PhotonSettings, pass: u64) -> Self {
        let class = |class: PhotonClass| {
            let is_in = |p: &&Photon| p.class == class;
            let count = traced.photons.iter().filter(is_in).count();
            // Most maps hold one class only: nothing to be copied.
            let copied: Vec<Photon>;
            let of_class = if count == traced.photons.len() {
                &traced.photons
            } else {
                copied = traced.photons.iter().filter(is_in).copied().collect();
                &copied
            };
            (count > 0).then(|| Estimator::new(world, of_class, settings, pass))
        };
        GlobalMap { classes: PhotonClass::ALL.map(class), ledger: traced.ledger }
    }

    fn chosen(&self, filter: Filter) -> impl Iterator<Item = &Estimator> {
        self.classes.iter().zip(filter.classes).filter_map(|(e, wanted)| e.as_ref().filter(|_| wanted))
    }

    /// Radiance towards `wo` by light of the classes that `filter` counts, scattered by `diffuse`, the diffuse part of the material at `at`.
    pub fn radiance(&self, at: &SurfacePoint, diffuse: &Bsdf, wo: Vec3, filter: Filter) -> Rgb {
        self.chosen(filter).map(|e| e.radiance(at, diffuse, wo, filter.most_segments)).sum()
    }

    /// Irradiance by light of the classes that `filter` counts, at `p` on the side of the unit normal `n_geo`.
    pub fn irradiance(&self, p: Vec3, n_geo: Vec3, filter: Filter) -> Rgb {
        self.chosen(filter).map(|e| e.irradiance(p, n_geo, filter.most_segments)).sum()
    }

    /// Photons of the classes that `filter` counts which count at `p` on the side of `n_geo`.
    pub fn found(&self, p: Vec3, n_geo: Vec3, filter: Filter) -> usize {
        self.chosen(filter).map(|e| e.found(p, n_geo)).sum()
    }

    /// Whether no photon was stored.
    pub fn is_empty(&self) -> bool {
        self.stored() == 0
    }

    /// Number of photons stored.
    pub fn stored(&self) -> usize {
        self.classes.iter().flatten().map(Estimator::len).sum()
    }

    /// Memory of the map, bytes.
    pub fn bytes(&self) -> usize {
        self.classes.iter().flatten().map(Estimator::bytes).sum()
    }
}
