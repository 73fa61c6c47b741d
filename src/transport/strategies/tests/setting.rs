//! A floor under lights, some of them hidden, and what sums over them need.

use crate::math::sampler::{hash, unit_f32};
use crate::math::{DVec3, Price, Rgb, Vec3};
use crate::scene::description::GeometryDesc;
use crate::scene::{Bsdf, SurfacePoint};
use crate::transport::strategies::coins::Coin;
use crate::transport::strategies::{LOOK, ManyLights, Receiver, Strategy, StrategySettings, Tally};
use crate::transport::surfels::Facet;
use crate::transport::tests::{Room, add, diffuse, empty, square};
use crate::transport::visibility::posterior::Posterior;
use crate::transport::visibility::{ShadingClusters, VisibilityCache};
use crate::transport::vpl::{Vpl, Vpls, mean};
use crate::transport::vpl_tree::VplTree;

/// A floor, and a plate above it that hides a part of the lights.
fn room() -> Room {
    let mut scene = empty();
    let grey = diffuse(&mut scene, 0.6);
    add(&mut scene, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 4.0), grey);
    add(&mut scene, GeometryDesc::Rectangle, square(DVec3::new(0.6, 0.5, 0.0), DVec3::Y, 0.3), grey);
    Room::new(scene)
}

pub fn random(i: u64, k: u64) -> f32 {
    unit_f32(hash(i, k))
}

/// Lights above the floor that face it more or less; some below it or turned away.
fn lights(n: u64, seed: u64) -> Vpls {
    let u = |i: u64, k: u64| random(seed * 1000 + i, k);
    let light = |i: u64| {
        let p = Vec3::new(3.0 * u(i, 0) - 1.0, 0.7 + 1.5 * u(i, 1), 2.0 * u(i, 2) - 1.0);
        let n = Vec3::new(u(i, 3) - 0.5, -0.6 - u(i, 4), u(i, 5) - 0.5).normalize();
        Vpl::lambertian(p, if i % 7 == 6 { -n } else { n }, Rgb::new(1.0, 0.5, 0.2) * (0.1 + u(i, 6)), 0.01)
    };
    Vpls::from_lights((0..n).map(light).collect())
}

/// Everything that a sum needs, with the floor point `at` that is shaded.
pub struct Setting {
    pub room: Room,
    pub vpls: Vpls,
    pub tree: VplTree,
    pub cache: VisibilityCache,
    pub posterior: Posterior,
    pub at: SurfacePoint,
    pub bsdf: Bsdf,
}

impl Setting {
    pub fn new(n: u64, seed: u64) -> Self {
        let room = room();
        let mut vpls = lights(n, seed);
        let mut tree = VplTree::build(&mut vpls);
        let point = |x: f32, z: f32| Facet {
            p: Vec3::new(x, 0.0, z),
            p_error: Vec3::ZERO,
            n_geo: Vec3::Y,
            n_shade: Vec3::Y,
            shape: 0,
        };
        let points = (0..40).map(|i| point(2.0 * random(i, 8) - 1.0, 2.0 * random(i, 9) - 1.0)).collect();
        let cache = VisibilityCache::build(room.world(), &ShadingClusters::new(points, 12), &vpls, 1, 0);
        tree.count_visible(&cache);
        let at = point(0.1, 0.05).surface_point();
        let bsdf = room.world().bsdf(&at, Vec3::Y);
        Setting { vpls, tree, cache, posterior: Posterior::default(), at, bsdf, room }
    }

    pub fn receiver(&self) -> Receiver<'_> {
        Receiver::new(&self.at, &self.bsdf, Vec3::Y, Rgb::ONE, [0, u32::MAX], 1)
    }

    pub fn many(&self, strategy: Strategy, lambda: f32) -> ManyLights<'_> {
        let settings = StrategySettings { strategy, ..StrategySettings::default() };
        let price = Price { look: LOOK, check: 1.0, lambda };
        ManyLights::new(self.room.world(), &self.vpls, &self.tree, Some(&self.cache), &self.posterior, settings, price)
    }

    pub fn with<C: Coin>(&self, many: &ManyLights, coins: [C; 2], key: u64) -> (Rgb, Tally) {
        let r = self.receiver();
        let near = self.cache.neighbours(r.at.p, r.normal());
        let mut tally = Tally::default();
        tally.begin(self.vpls.lights.len());
        let sum = many.sum_with(&r, Some(&near), coins, key, &mut tally);
        tally.end(mean(sum));
        (sum, tally)
    }

    /// The sum with all rays, by the plainest code there is.
    pub fn truth(&self) -> Rgb {
        let r = self.receiver();
        let world = self.room.world();
        let one = |l: &Vpl| {
            let d = l.p - r.at.p;
            let ray = world.shadow_ray(r.at, d.normalize(), d.length());
            r.tentative(&self.vpls, l) * world.transmittance(ray, false).share
        };
        self.vpls.lights.iter().map(one).sum()
    }
}
