//! Records of the irradiance cache on both sides of an edge of light.

use super::*;
use crate::math::luminance;
use crate::transport::surfels::Facet;
use crate::transport::{CacheSettings, HitLight, IrradianceCache, Place};

/// The hole in the screen at y = 1 and the bright plate at y = 2, along x and z.
const HOLE: [f64; 2] = [-0.3, 0.3];
const PLATE: f64 = 0.1;
/// Irradiance of the plate.
const BRIGHT: f32 = 1000.0;

/// Irradiance of the floor at (x, 0, z) by the plate as the hole shows it.
fn expected(x: f64, z: f64) -> f64 {
    // The hole seen on the plane of the plate.
    let side = |at: f64| HOLE.map(|h| (at + 2.0 * (h - at)).clamp(-PLATE, PLATE));
    let ([x0, x1], [z0, z1]) = (side(x), side(z));
    if x0 >= x1 || z0 >= z1 {
        return 0.0;
    }
    let corners = [[x0, z0], [x0, z1], [x1, z1], [x1, z0]].map(|[a, b]| DVec3::new(a - x, 2.0, b - z));
    f64::from(BRIGHT) * polygon::irradiance(&corners, DVec3::Y).abs() / f64::from(PI)
}

#[test]
fn records_do_not_carry_light_over_an_edge_that_lies_between_them() {
    let mut scene = empty();
    scene.lights.clear();
    add_screened_floor(&mut scene, HOLE);
    let white = diffuse(&mut scene, 1.0);
    add(&mut scene, GeometryDesc::Rectangle, square(DVec3::new(0.0, 2.0, 0.0), -DVec3::Y, PLATE), white);
    let room = Room::new(scene);
    let world = room.world();
    let total = |p: Vec3, _: Vec3| Rgb::splat(if p.y > 1.5 { BRIGHT } else { 0.0 });
    // Places anywhere, in levels.
    let place = |i: u64| {
        let u = Sampler::new(3, 1, i).next_2d();
        let at = Vec3::new(2.4 * u.x - 1.2, 0.0, 2.4 * u.y - 1.2);
        let down =
            world.gather(at + Vec3::Y * 0.5, -Vec3::Y, &mut Sampler::new(1, 1, i), &mut Default::default(), |_| {});
        let end = down.end.expect("the floor is there");
        Place { facet: Facet::seen_from(&end.at, end.wo), pixel: 0.01 }
    };
    let places: Vec<Place> = (0..4000).map(place).collect();
    let mut cache = IrradianceCache::new(world, CacheSettings { max_radius: 1e-3, ..CacheSettings::default() });
    for level in [40, 400, 4000] {
        cache.fill(&places[..level], &HitLight::Map { total: &total }, usize::MAX);
    }
    cache.finish();
    let peak = expected(0.0, 0.0);
    let error = |p: &Place| {
        let Facet { p, n_shade, n_geo, .. } = p.facet;
        let got = cache.lookup(p, n_shade, n_geo).map_or(0.0, |e| f64::from(luminance(e)));
        (got - expected(f64::from(p.x), f64::from(p.z))) / peak
    };
    let [mean, rms, _] = moments(&places.iter().map(error).collect::<Vec<f64>>());
    // Where records only learn how far others reach, -0.13 and 0.27: dark ones reach into the light.
    assert!(mean.abs() < 0.02 && rms < 0.1, "{mean}, root mean square {rms}");
    assert!(cache.records().len() < 400, "{} records", cache.records().len());
}
