//! The irradiance cache used again: threads, other lights, finer bounds, files, places without a camera.

mod common;

use common::cache::*;
use common::*;
use dualux::math::{DMat4, DVec3, Rgb, Vec3};
use dualux::scene::description::*;
use dualux::scene::{Color, Description, Material};
use dualux::transport::surfels::Facet;
use dualux::transport::{CacheSettings, HitLight, IrradianceCache, Place, World};
use std::f32::consts::PI;

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let ready = Ready::new(lit_box());
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 3000, |_| true);
    let bits = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| {
            let cache =
                fill(ready.world(), CacheSettings::default(), &places, &HitLight::Operator { caustic: &nothing });
            places.iter().map(|p| look(&cache, p).to_array().map(f32::to_bits)).collect::<Vec<_>>()
        })
    };
    let one = bits(1);
    assert!(one == bits(2) && one == bits(7));
}

#[test]
fn another_light_needs_no_gather_ray_and_back_again_is_the_same() {
    let lit_from = |x: f64| {
        let mut desc = closed_box(0.6, None);
        point_light(&mut desc, DVec3::new(x, 0.4, 0.1), 1.0);
        Ready::new(desc)
    };
    let (first, second) = (lit_from(-0.5), lit_from(0.6));
    let places = first.places(Vec3::new(0.1, 0.2, -0.3), 3000, |_| true);
    let light = HitLight::Operator { caustic: &nothing };
    let mut cache = fill(first.world(), CacheSettings::default(), &places, &light);
    let before: Vec<Rgb> = cache.records().iter().map(|r| r.irradiance).collect();
    let rays = |c: &IrradianceCache| (c.statistics().record_rays.rays, c.statistics().surfel_rays.rays);
    let traced = rays(&cache);
    let shadow_rays = cache.statistics().surfel_rays.shadow_rays;

    cache.relight(second.world(), &light);
    assert_eq!(rays(&cache), traced, "no gather ray");
    assert!(cache.statistics().surfel_rays.shadow_rays > shadow_rays, "shadow rays only");
    let changed =
        cache.records().iter().zip(&before).filter(|(r, e)| (r.irradiance.x / e.x - 1.0).abs() > 0.05).count();
    assert!(4 * changed > before.len(), "the light has moved: {changed} of {}", before.len());
    for (i, record) in cache.records().iter().enumerate().step_by(before.len() / 8) {
        let facet =
            Facet { p: record.p, p_error: Vec3::splat(1e-6), n_geo: record.frame.n, n_shade: record.frame.n, shape: 0 };
        let (expected, sigma) = brute_force(&second.world(), &facet, 20_000, i as u64);
        let got = record.irradiance.x;
        assert!((got - expected).abs() < 0.08 * expected + 3.0 * sigma, "{got}, not {expected} +- {sigma}");
    }

    cache.relight(first.world(), &light);
    assert!(cache.records().iter().zip(&before).all(|(r, e)| r.irradiance == *e), "bit for bit");
    assert_eq!(rays(&cache), traced);
}

#[test]
fn refining_keeps_records_and_adds_more() {
    let ready = Ready::new(lit_box());
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 4000, |_| true);
    let light = HitLight::Operator { caustic: &nothing };
    let mut cache = fill(ready.world(), CacheSettings { error: 0.1, ..CacheSettings::default() }, &places, &light);
    let before: Vec<Vec3> = cache.records().iter().map(|r| r.p).collect();
    cache.refine(0.005);
    cache.fill(&places, &light, 50);
    assert_eq!(cache.records().len(), before.len() + 50, "no more than allowed");
    assert!(cache.statistics().left > 0);
    cache.fill(&places, &light, usize::MAX);
    assert!(cache.records().len() > before.len() + 100, "{} after {}", cache.records().len(), before.len());
    assert!(cache.records().iter().zip(&before).all(|(r, p)| r.p == *p));
    assert!(places.iter().all(|p| cache.covers(&p.facet)));
}

#[test]
fn a_file_gives_the_same_cache_back_and_wrong_files_are_refused() {
    use dualux::transport::cache_file::CacheFileError;
    let ready = Ready::new(lit_box());
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 1500, |_| true);
    let light = HitLight::Operator { caustic: &nothing };
    let mut cache = fill(ready.world(), CacheSettings::default(), &places, &light);
    let bytes = cache.to_bytes();
    let file = IrradianceCache::from_bytes(ready.world(), &bytes).expect("its own file");
    assert!(file.same_light);
    let mut read = file.cache;
    assert_eq!(read.statistics(), cache.statistics());
    assert!(places.iter().all(|p| look(&read, p) == look(&cache, p)));
    // It goes on as the one that was never written would.
    for c in [&mut cache, &mut read] {
        c.refine(0.005);
        c.fill(&places, &light, 100);
        c.finish();
    }
    let found = |c: &IrradianceCache, p: &Place| c.lookup(p.facet.p, p.facet.n_shade, p.facet.n_geo);
    assert!(places.iter().all(|p| found(&read, p) == found(&cache, p)));

    let refused = |bytes: &[u8], world: World| match IrradianceCache::from_bytes(world, bytes) {
        Ok(_) => panic!("a wrong file was read"),
        Err(e) => e,
    };
    let changed = |at: usize| {
        let mut b = bytes.clone();
        b[at] ^= 1;
        b
    };
    assert!(matches!(refused(&changed(0), ready.world()), CacheFileError::NoCache));
    assert!(matches!(refused(&[], ready.world()), CacheFileError::NoCache));
    assert!(matches!(refused(&changed(16), ready.world()), CacheFileError::Version { .. }));
    assert!(matches!(refused(&changed(bytes.len() / 2), ready.world()), CacheFileError::Damaged));
    for cut in [17, 20, 40, bytes.len() - 1] {
        assert!(matches!(refused(&bytes[..cut], ready.world()), CacheFileError::Damaged));
    }
    let other = Ready::new(two_rooms(true));
    assert!(matches!(refused(&bytes, other.world()), CacheFileError::OtherScene));
    let repainted = |desc: &mut Description| {
        desc.materials.iter_mut().for_each(|m| {
            if let Material::Diffuse { reflectance } = m {
                *reflectance = Color::Constant(Rgb::splat(0.123));
            }
        });
    };
    let mut desc = lit_box();
    repainted(&mut desc);
    let other = Ready::new(desc);
    assert!(matches!(refused(&bytes, other.world()), CacheFileError::OtherMaterials));
}

/// A mesh of two triangles on the floor of a box: the vertex they share moves without a change of any bounding box.
fn box_with_mesh(x: f32) -> Description {
    let mut scene = lit_box();
    let grey = diffuse(&mut scene, 0.5);
    let corners = [[-0.5, -0.5, -0.5], [0.5, -0.5, -0.5], [0.5, -0.5, 0.5], [-0.5, -0.5, 0.5], [x, -0.4, 0.0]];
    let mesh = dualux::scene::mesh::MeshData {
        positions: corners.map(Vec3::from_array).to_vec(),
        triangles: vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]],
        face_normals: true,
        ..Default::default()
    };
    shape(&mut scene, GeometryDesc::Mesh(mesh), DMat4::IDENTITY, grey, None);
    scene
}

#[test]
fn a_file_knows_its_geometry_to_the_last_vertex_and_tells_of_other_lights() {
    use dualux::transport::cache_file::CacheFileError;
    let ready = Ready::new(box_with_mesh(0.0));
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 300, |_| true);
    let light = HitLight::Operator { caustic: &nothing };
    let cache = fill(ready.world(), CacheSettings::default(), &places, &light);
    let bytes = cache.to_bytes();
    let moved = Ready::new(box_with_mesh(1e-3));
    let refused = IrradianceCache::from_bytes(moved.world(), &bytes).expect_err("a vertex has moved");
    assert!(matches!(refused, CacheFileError::OtherScene), "{refused}");

    let mut desc = box_with_mesh(0.0);
    point_light(&mut desc, DVec3::new(0.3, 0.4, 0.5), 2.0);
    let other = Ready::new(desc);
    let file = IrradianceCache::from_bytes(other.world(), &bytes).expect("the same shapes");
    assert!(!file.same_light);
    let mut relit = file.cache;
    relit.relight(other.world(), &light);
    assert_eq!(relit.statistics().record_rays.rays, cache.statistics().record_rays.rays, "no gather ray is traced");
    let sum = |c: &IrradianceCache| c.records().iter().map(|r| r.irradiance.x).sum::<f32>();
    assert!(sum(&relit) > 1.2 * sum(&cache), "{} {}", sum(&relit), sum(&cache));
}

#[test]
fn places_over_the_whole_scene_serve_every_point() {
    use dualux::transport::cache_placement::{UniformPlaces, pierced_places};
    let ready = Ready::new(lit_box());
    let world = ready.world();
    let pierced = pierced_places(&world, &[Vec3::new(0.1, 0.2, -0.3)], 2000, 0.0, 1);
    assert_eq!(pierced.len(), 2000, "a box is pierced once by each ray, and its walls are black outside");
    // Least radius 0.1, so that 0.04 from a place is near enough.
    let uniform = UniformPlaces::for_distance(&world, 0.04, 0.05, 1);
    let places = uniform.sample(&world);
    assert!((places.len() as f32 / (6.9 * 24.0 / (PI * 0.04 * 0.04)) - 1.0).abs() < 0.01);
    let settings = CacheSettings { error: 0.1, ..CacheSettings::default() };
    let light = HitLight::Operator { caustic: &nothing };
    let mut cache = IrradianceCache::new(world, settings);
    cache.fill(&places[..2000], &light, usize::MAX);
    cache.fill(&places, &light, usize::MAX);
    cache.finish();
    let seen = ready.places(Vec3::new(-0.4, 0.5, 0.3), 20_000, |_| true);
    let served = |p: &&Place| cache.lookup(p.facet.p, p.facet.n_shade, p.facet.n_geo).is_some();
    let missing = seen.len() - seen.iter().filter(served).count();
    assert!(missing * 2000 < seen.len(), "{missing} of {}", seen.len());
}
