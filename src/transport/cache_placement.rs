//! Places for records all over the scene, whatever the camera sees.
//!
//! * [`pierced_places`]: at every surface that rays from some points inside the scene pierce (they go on behind it)
//! * [`UniformPlaces`]: uniform by area on both sides of all diffuse surfaces
//!
//! Coverage    the first kind thins out at edges and grazing surfaces and guarantees nothing. With the second, let every
//!             point be within D of a place. The places are covered at d < 1, look-ups reach to d < b (`cache_record.rs`), so
//!             every point is served as soon as D <= (b - 1) R_min: the reason for the looser threshold of look-ups. n places
//!             on the area A leave a disc of radius D empty with the probability exp(-n pi D^2 / A);
//!             [`UniformPlaces::for_distance`] asks for 1e-3
//! Source      Yue, Onoue and Nishita (piercing rays, two thresholds); METHODS.md section 4.A (the guarantee)
//! Not handled whether anyone will ever see a place: the inside of closed objects is covered as well
//! Verified by tests/irradiance_cache.rs: every point of a room is served

use super::Place;
use super::World;
use crate::accel::Ray;
use crate::math::distribution::AliasTable;
use crate::math::sampler::hash;
use crate::math::{Rgb, Sampler, Vec2, Vec3, warp};
use crate::scene::SurfacePoint;
use std::f32::consts::PI;

/// Most surfaces that one piercing ray passes.
const MAX_PIERCED: u32 = 64;
/// Most places over a whole scene.
const MAX_PLACES: f32 = 4e6;
/// - ln of the probability that a disc of the wanted size stays empty.
const SURE: f32 = 6.9;
/// Streams of random numbers.
const PIERCE: u64 = 0x9a1;
const UNIFORM: u64 = 0x9a2;

/// The sides of a surface point that have a diffuse part.
fn diffuse_sides(world: &World, at: &SurfacePoint, pixel: f32) -> impl Iterator<Item = Place> {
    let side = |wo: Vec3| {
        let (diffuse, _) = world.bsdf(at, wo).split();
        let reflects = diffuse.is_some_and(|d| d.albedo(wo) != Rgb::ZERO);
        reflects.then(|| Place::new(at, wo, pixel))
    };
    [at.n_geo, -at.n_geo].map(side).into_iter().flatten()
}

/// Every surface that `rays` rays from each of `origins` pierce, in order; `pixel` as in [`Place`].
pub fn pierced_places(world: &World, origins: &[Vec3], rays: u32, pixel: f32, seed: u64) -> Vec<Place> {
    let mut places = Vec::new();
    for (i, &origin) in origins.iter().enumerate() {
        for k in 0..rays {
            let mut rng = Sampler::new(hash(seed, PIERCE), i as u64, u64::from(k));
            let d = warp::sample_sphere(rng.next_2d());
            let mut ray = Ray { o: origin, d, tmin: 0.0, tmax: f32::INFINITY };
            for _ in 0..MAX_PIERCED {
                let Some(hit) = world.accel.closest(&ray) else { break };
                let at = world.surface(&ray, &hit);
                places.extend(diffuse_sides(world, &at, pixel));
                ray = Ray { tmax: ray.tmax, ..Ray::leaving(&at, d) };
            }
        }
    }
    places
}

/// Places uniform by area over a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformPlaces {
    /// Number of points; each gives a place for every diffuse side.
    pub points: u32,
    /// As in [`Place`]: what the least radius of a record is in units of.
    pub pixel: f32,
    /// Seed.
    pub seed: u64,
}

impl UniformPlaces {
    /// So many points that hardly any surface is farther than `distance` from one.
    pub fn for_distance(world: &World, distance: f32, pixel: f32, seed: u64) -> Self {
        let area: f32 = world.scene.shapes.iter().map(|s| s.area()).sum();
        let points = (SURE * area / (PI * distance * distance)).ceil().min(MAX_PLACES);
        UniformPlaces { points: points.max(1.0) as u32, pixel, seed }
    }

    /// The places; any first part of them is uniform as well, so they can be filled in levels.
    pub fn sample(&self, world: &World) -> Vec<Place> {
        let shapes = &world.scene.shapes;
        let prims: Vec<(u32, u32)> = (0..shapes.len() as u32)
            .flat_map(|s| (0..shapes[s as usize].primitive_count() as u32).map(move |p| (s, p)))
            .collect();
        let areas: Vec<f64> = prims.iter().map(|&(s, p)| f64::from(shapes[s as usize].primitive_area(p))).collect();
        let table = AliasTable::new(&areas);
        let mut places = Vec::new();
        for i in 0..self.points {
            let [ux, uy, u_prim, more] = Sampler::new(hash(self.seed, UNIFORM), 0, u64::from(i)).next_4d();
            // 24 bits do not resolve a table of many triangles.
            let u = (f64::from(u_prim) + f64::from(more) * 2f64.powi(-24)).min(1.0 - f64::EPSILON);
            let Some(index) = table.sample(u) else { break };
            let (shape, prim) = prims[index];
            let (at, _) = shapes[shape as usize].sample_area(shape, prim, Vec2::new(ux, uy));
            places.extend(diffuse_sides(world, &at, self.pixel));
        }
        places
    }
}
