//! What tests of the irradiance cache share: rooms, a filled cache, brute force.
#![allow(dead_code)] // not every test file uses every function

use super::*;
use dualux::math::sampler::hash;
use dualux::math::{Frame, Sampler, Vec3, warp};
use dualux::scene::SurfacePoint;
use dualux::transport::gather_ray::RayCounts;
use dualux::transport::surfel_direct::direct_irradiance;
use dualux::transport::surfels::Facet;
use dualux::transport::{CacheSettings, HitLight, IrradianceCache, Place};

pub struct Ready {
    pub scene: Scene,
    pub accel: Accel,
}

impl Ready {
    pub fn new(desc: Description) -> Self {
        let scene = Scene::new(desc).expect("the scene is valid");
        let accel = Accel::new(&scene.shapes);
        Ready { scene, accel }
    }

    pub fn world(&self) -> World<'_> {
        World::new(&self.scene, &self.accel)
    }

    /// Places by `n` rays from `eye` in all directions, of those within `keep`.
    pub fn places(&self, eye: Vec3, n: u64, keep: impl Fn(&SurfacePoint) -> bool) -> Vec<Place> {
        let mut out = Vec::new();
        for i in 0..n {
            let d = warp::sample_sphere(Sampler::new(3, 3, i).next_2d());
            let g = self.world().gather(eye, d, &mut Sampler::new(1, 1, i), &mut RayCounts::default(), |_| {});
            if let Some(end) = g.end
                && keep(&end.at)
            {
                out.push(Place::new(&end.at, end.wo, 0.002));
            }
        }
        out
    }
}

pub fn room() -> Description {
    empty_scene(DVec3::new(0.0, 0.0, -0.9), DVec3::ZERO, 8, 8)
}

/// A rectangle with the half edges `ex`, `ey` around `center`; its normal is their cross product.
pub fn rectangle(
    scene: &mut Description,
    center: DVec3,
    ex: DVec3,
    ey: DVec3,
    material: MaterialId,
    emission: Option<f32>,
) {
    let n = ex.cross(ey).normalize();
    let to_world = DMat4::from_cols(ex.extend(0.0), ey.extend(0.0), n.extend(0.0), center.extend(1.0));
    shape(scene, GeometryDesc::Rectangle, to_world, material, emission);
}

pub fn two_sided(scene: &mut Description, albedo: f32) -> MaterialId {
    let side = diffuse(scene, albedo);
    material(scene, Material::TwoSided { front: side, back: side })
}

/// A closed box `[-1,1]^3` of diffuse walls.
pub fn closed_box(albedo: f32, emission: Option<f32>) -> Description {
    let mut scene = room();
    let wall = diffuse(&mut scene, albedo);
    shape(&mut scene, GeometryDesc::Cube, DMat4::IDENTITY, wall, emission);
    scene.shapes[0].flip_normals = true;
    scene
}

pub fn point_light(scene: &mut Description, position: DVec3, intensity: f32) {
    scene.lights.push(LightDesc::Point { position, intensity: Rgb::splat(intensity) });
}

pub fn nothing(_: Vec3, _: Vec3) -> Rgb {
    Rgb::ZERO
}

pub fn fill<'a>(world: World<'a>, settings: CacheSettings, places: &[Place], light: &HitLight) -> IrradianceCache<'a> {
    let mut cache = IrradianceCache::new(world, settings);
    cache.fill(places, light, usize::MAX);
    cache.finish();
    cache
}

pub fn look(cache: &IrradianceCache, place: &Place) -> Rgb {
    let f = place.facet;
    cache.lookup(f.p, f.n_shade, f.n_geo).expect("the place is covered")
}

/// Indirect irradiance by `paths` paths, mean and standard error.
pub fn brute_force(world: &World, at: &Facet, paths: u64, key: u64) -> (f32, f32) {
    let mut counts = RayCounts::default();
    let (mut sum, mut squares) = (0f64, 0f64);
    for i in 0..paths {
        let mut rng = Sampler::new(99, key, i);
        let (mut place, mut throughput, mut value) = (*at, Rgb::ONE, 0.0);
        for depth in 0..40u64 {
            let frame = Frame::from_normal(place.n_shade);
            let d = frame.to_world(warp::sample_cosine_hemisphere(rng.next_2d()));
            let o = place.surface_point().spawn_origin(d);
            let Some(end) = world.gather(o, d, &mut rng, &mut counts, |_| {}).end else { break };
            throughput *= end.weight;
            place = Facet::seen_from(&end.at, end.wo);
            value += f64::from((throughput * direct_irradiance(world, &place, 1, hash(key, depth), i, &mut counts)).x);
        }
        sum += value;
        squares += value * value;
    }
    let n = paths as f64;
    let mean = sum / n;
    (mean as f32, ((squares / n - mean * mean) / n).sqrt() as f32)
}

/// A box lit by a point light, white but for one dark wall.
pub fn lit_box() -> Description {
    let mut desc = closed_box(0.6, None);
    point_light(&mut desc, DVec3::new(0.2, 0.4, 0.1), 1.0);
    desc
}

/// Two rooms side by side, with a wall without thickness between them; the lamp is in the left one.
pub fn two_rooms(wall: bool) -> Description {
    let mut desc = room();
    let white = two_sided(&mut desc, 0.7);
    let stretch = DMat4::from_scale(DVec3::new(2.0, 1.0, 1.0));
    shape(&mut desc, GeometryDesc::Cube, stretch, white, None);
    if wall {
        rectangle(&mut desc, DVec3::new(0.0013, 0.0, 0.0), DVec3::Y, DVec3::Z, white, None);
    }
    point_light(&mut desc, DVec3::new(-0.9, 0.4, 0.1), 1.0);
    desc
}
