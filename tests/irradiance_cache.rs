//! The irradiance cache against closed forms and brute force.

mod common;

use common::cache::*;
use common::*;
use dualux::math::{DMat4, DVec3, Frame, Rgb, Sampler, Vec3, warp};
use dualux::scene::description::*;
use dualux::scene::{Color, Description, Material, SurfacePoint};
use dualux::transport::cache_record::{BORDER, Record};
use dualux::transport::gather_ray::RayCounts;
use dualux::transport::surfels::Facet;
use dualux::transport::{CacheSettings, HitLight, IrradianceCache, Place, World};
use std::f32::consts::PI;

#[test]
fn a_constant_field_is_exact() {
    // Hits of irradiance 2 with albedo 0.4 everywhere: E = 0.8, no derivatives, wherever one looks.
    let ready = Ready::new(closed_box(0.4, None));
    let total = |_: Vec3, _: Vec3| Rgb::splat(2.0);
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 3000, |_| true);
    let cache = fill(ready.world(), CacheSettings::default(), &places, &HitLight::Map { total: &total });
    assert!(cache.records().len() > 20);
    for place in &places {
        assert!((look(&cache, place) - Rgb::splat(0.8)).abs().max_element() < 1e-5);
    }
}

#[test]
fn closed_furnaces_show_the_geometric_series() {
    // E_total = pi L / (1 - rho), of which pi L comes directly from the walls.
    for (geometry, tolerance) in
        [(GeometryDesc::Sphere { center: DVec3::ZERO, radius: 1.0 }, 1e-3), (GeometryDesc::Cube, 2e-3)]
    {
        for albedo in [0.3f32, 0.8] {
            let mut desc = room();
            let wall = diffuse(&mut desc, albedo);
            shape(&mut desc, geometry.clone(), DMat4::IDENTITY, wall, Some(1.0));
            desc.shapes[0].flip_normals = true;
            let ready = Ready::new(desc);
            let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 2000, |_| true);
            let settings = CacheSettings { light_samples: 64, ..CacheSettings::default() };
            let cache = fill(ready.world(), settings, &places, &HitLight::Operator { caustic: &nothing });
            let mean = places.iter().map(|p| look(&cache, p).x).sum::<f32>() / places.len() as f32;
            let expected = PI * albedo / (1.0 - albedo);
            assert!((mean / expected - 1.0).abs() < tolerance, "albedo {albedo}: {mean}, not {expected}");
        }
    }
}

#[test]
fn one_bounce_is_the_first_term_of_the_series_and_caustics_add_to_it() {
    let ready = Ready::new(closed_box(0.5, Some(1.0)));
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 500, |_| true);
    let settings = CacheSettings { light_samples: 64, ..CacheSettings::default() };
    let caustic = |_: Vec3, _: Vec3| Rgb::splat(1.0);
    for (light, expected) in [
        (HitLight::OneBounce { caustic: &nothing }, 0.5 * PI),
        (HitLight::OneBounce { caustic: &caustic }, 0.5 * (PI + 1.0)),
        (HitLight::Operator { caustic: &caustic }, PI + 1.0),
    ] {
        let cache = fill(ready.world(), settings, &places, &light);
        let mean = places.iter().map(|p| look(&cache, p).x).sum::<f32>() / places.len() as f32;
        assert!((mean / expected - 1.0).abs() < 5e-3, "{mean}, not {expected}");
    }
}

#[test]
fn mirrors_and_glossy_walls_pass_the_light_on() {
    // A furnace with a mirror for one wall, where all lamps are diffuse walls: E = pi L rho / (1 - rho) only if the light
    // that the mirror shows of the lamps is added as a caustic, so here the point light in a box with a mirror wall is
    // compared with paths instead.
    for (k, alpha) in [(0u64, None), (1, Some(0.3))] {
        let mut desc = room();
        let wall = diffuse(&mut desc, 0.6);
        let (eta, white) = (Color::Constant(Rgb::ZERO), Color::Constant(Rgb::ONE));
        let specular_reflectance = Color::Constant(Rgb::splat(0.9));
        let metal = match alpha {
            None => Material::Conductor { eta, k: white, specular_reflectance },
            Some(a) => {
                let alpha = dualux::scene::Scalar::Constant(a);
                let distribution = dualux::scene::material::Distribution::Ggx;
                let roughness =
                    dualux::scene::material::Roughness { distribution, alpha_u: alpha.clone(), alpha_v: alpha };
                Material::RoughConductor { eta, k: white, specular_reflectance, roughness }
            }
        };
        let metal = material(&mut desc, metal);
        shape(&mut desc, GeometryDesc::Cube, DMat4::IDENTITY, wall, None);
        desc.shapes[0].flip_normals = true;
        rectangle(&mut desc, DVec3::new(0.99, 0.0, 0.0), DVec3::Y * 0.99, -DVec3::Z * 0.99, metal, None);
        desc.shapes[1].flip_normals = false;
        point_light(&mut desc, DVec3::new(-0.2, 0.3, 0.1), 1.0);
        let ready = Ready::new(desc);
        let floor = |at: &SurfacePoint| at.n_geo.y > 0.9 && at.p.x < 0.8;
        let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 1500, floor);
        let cache = fill(ready.world(), CacheSettings::default(), &places, &HitLight::Operator { caustic: &nothing });
        let mut mean = [0.0; 2];
        for place in places.iter().step_by(places.len() / 8) {
            // Where the metal is smooth neither side has its caustics; where it is rough both sample its light.
            let (expected, error) = with_glossy(&ready.world(), &place.facet, 20_000, k);
            let got = look(&cache, place).x;
            assert!((got - expected).abs() < 0.1 * expected + 4.0 * error, "{k}: {got}, not {expected} +- {error}");
            mean[0] += got;
            mean[1] += expected;
        }
        assert!((mean[0] / mean[1] - 1.0).abs() < 0.03, "{k}: {mean:?}");
    }
}

/// As [`brute_force`], with what glossy surfaces on the way scatter from lamps.
fn with_glossy(world: &World, at: &Facet, paths: u64, key: u64) -> (f32, f32) {
    let (diffuse, error) = brute_force(world, at, paths, key);
    // Rays of any depth: the same walk once more, with the light samples of glossy vertices only.
    let mut counts = RayCounts::default();
    let (mut sum, mut squares) = (0f64, 0f64);
    for i in 0..paths {
        let mut rng = Sampler::new(98, key, i);
        let (mut place, mut throughput, mut value) = (*at, Rgb::ONE, 0.0);
        for _ in 0..40 {
            let frame = Frame::from_normal(place.n_shade);
            let d = frame.to_world(warp::sample_cosine_hemisphere(rng.next_2d()));
            let o = place.surface_point().spawn_origin(d);
            let mut vertices = Vec::new();
            let g = world.gather(o, d, &mut rng, &mut counts, |v| vertices.push(v));
            for v in &vertices {
                let l = dualux::transport::gather_ray::glossy_direct(world, v, &mut rng, &mut counts);
                value += f64::from((throughput * l).x * PI);
            }
            let Some(end) = g.end else { break };
            throughput *= end.weight;
            place = Facet::seen_from(&end.at, end.wo);
        }
        sum += value;
        squares += value * value;
    }
    let n = paths as f64;
    let mean = sum / n;
    (diffuse + mean as f32, error + ((squares / n - mean * mean) / n).sqrt() as f32)
}

#[test]
fn agrees_with_brute_force_in_the_middle_and_in_the_corner_and_the_bound_of_the_error_counts() {
    let ready = Ready::new(lit_box());
    let world = ready.world();
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 30_000, |at| at.n_geo.y > 0.9);
    let caches = [0.3, 0.01].map(|error| {
        let settings = CacheSettings { error, ..CacheSettings::default() };
        fill(world, settings, &places, &HitLight::Operator { caustic: &nothing })
    });
    let wanted: Vec<&Place> = places
        .iter()
        .filter(|p| p.facet.p.x.abs().max(p.facet.p.z.abs()) > 0.93)
        .step_by(60)
        .chain(places.iter().filter(|p| p.facet.p.x.abs().max(p.facet.p.z.abs()) < 0.9).step_by(900))
        .collect();
    assert!(wanted.len() > 10);
    let mut errors = [0.0f32; 2];
    for (i, place) in wanted.iter().enumerate() {
        let (expected, sigma) = brute_force(&world, &place.facet, 30_000, i as u64);
        let got = [0, 1].map(|k| look(&caches[k], place).x);
        assert!((got[1] - expected).abs() < 0.06 * expected + 3.0 * sigma, "{}: {} {expected}", place.facet.p, got[1]);
        for k in 0..2 {
            errors[k] += (got[k] / expected - 1.0).powi(2);
        }
    }
    let rms = errors.map(|e| (e / wanted.len() as f32).sqrt());
    assert!(rms[1] < 0.025 && rms[1] < rms[0], "{rms:?}");
    assert!(caches[1].records().len() > caches[0].records().len());
}

/// Light of hits on the floor alone, bright in its middle.
fn bright_floor(p: Vec3, n: Vec3) -> Rgb {
    let q = p.x * p.x + p.z * p.z;
    if n.y > 0.9 { Rgb::splat(0.1 + 4.0 * (-6.0 * q).exp()) } else { Rgb::splat(0.1) }
}

/// What the records say at a place, with their second derivatives and without.
fn interpolated(cache: &IrradianceCache, place: &Place) -> [f32; 2] {
    let f = place.facet;
    let (mut sums, mut weights) = ([0.0; 2], 0.0);
    for record in cache.records() {
        if let Some(d) = record.distance(f.p, f.n_shade, f.n_geo) {
            let w = 1.0 - d / BORDER;
            let flat = Record { curvature: [0.0; 3], ..*record };
            for (sum, r) in sums.iter_mut().zip([record, &flat]) {
                *sum += w * r.predict(f.p, f.n_shade).x;
            }
            weights += w;
        }
    }
    sums.map(|sum| sum / weights)
}

#[test]
fn below_a_dome_of_irradiance_the_mean_is_that_of_gathering_and_that_of_tangents_is_not() {
    let ready = Ready::new(closed_box(0.5, None));
    let world = ready.world();
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 6000, |at| at.p.y > 0.999);
    let middle = |p: &&Place| p.facet.p.x.abs().max(p.facet.p.z.abs()) < 0.6;
    let wanted: Vec<&Place> = places.iter().filter(middle).collect();
    assert!(wanted.len() > 200, "{}", wanted.len());
    // What gather rays bring at each place.
    let mut expected = 0.0;
    for (k, place) in wanted.iter().enumerate() {
        let frame = Frame::from_normal(place.facet.n_shade);
        let ray = |i| {
            let mut rng = Sampler::new(5, k as u64, i);
            let d = frame.to_world(warp::sample_cosine_hemisphere(rng.next_2d()));
            let o = place.facet.surface_point().spawn_origin(d);
            let end = world.gather(o, d, &mut rng, &mut RayCounts::default(), |_| {}).end.expect("the box is closed");
            (end.weight * bright_floor(end.at.p, Facet::seen_from(&end.at, end.wo).n_geo)).x
        };
        expected += (0..1024).map(ray).sum::<f32>() / 1024.0;
    }
    // Several caches: the noise of one is as large as the bias.
    let mut sums = [0.0; 2];
    const CACHES: u64 = 8;
    for seed in 0..CACHES {
        let settings = CacheSettings { error: 0.02, seed, ..CacheSettings::default() };
        let cache = fill(world, settings, &places, &HitLight::Map { total: &bright_floor });
        for place in &wanted {
            let e = interpolated(&cache, place);
            assert!((e[0] - look(&cache, place).x).abs() < 1e-4 * e[0]);
            sums[0] += e[0] / CACHES as f32;
            sums[1] += e[1] / CACHES as f32;
        }
    }
    let [second, first] = sums.map(|sum| sum / expected - 1.0);
    println!("with second derivatives {second}, with tangents {first}");
    assert!(second.abs() < 0.006, "{second}");
    assert!(first > 0.008, "tangents lie above a dome: {first}");
}

#[test]
fn what_a_ball_of_glass_shows_of_the_floor_below_has_small_cells() {
    let near = |with_ball: bool| {
        let mut desc = closed_box(0.5, None);
        let glass =
            Material::Dielectric { eta: 1.5, specular_reflectance: grey(1.0), specular_transmittance: grey(1.0) };
        let glass = material(&mut desc, glass);
        if with_ball {
            let ball = GeometryDesc::Sphere { center: DVec3::new(0.0, -0.7, 0.0), radius: 0.3 };
            shape(&mut desc, ball, DMat4::IDENTITY, glass, None);
        }
        let ready = Ready::new(desc);
        let places = ready.places(Vec3::new(0.1, 0.5, -0.3), 4000, |at| at.p.y > 0.999);
        let cache = fill(ready.world(), CacheSettings::default(), &places, &HitLight::Map { total: &bright_floor });
        let surfels = cache.surfels().expect("there are surfels");
        let under = |f: &&Facet| f.p.y < -0.999 && f.p.x.hypot(f.p.z) < 0.1;
        surfels.surfels.places().iter().filter(under).count() as f32 * surfels.surfels.cell().powi(2)
    };
    let [covered, open] = [near(true), near(false)];
    println!("surfels below the ball {covered}, without it {open}, over those of the largest cells");
    assert!(covered > 4.0 * open, "{covered} {open}");
}

#[test]
fn a_vanishing_bound_reproduces_gathering_at_each_point() {
    let ready = Ready::new(lit_box());
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 300, |_| true);
    let tiny: Vec<Place> = places.iter().map(|p| Place { pixel: 0.0, ..*p }).collect();
    let settings = CacheSettings { error: 1e-12, ..CacheSettings::default() };
    let cache = fill(ready.world(), settings, &tiny, &HitLight::Operator { caustic: &nothing });
    assert_eq!(cache.records().len(), tiny.len());
    for place in &tiny {
        let own = cache.records().iter().find(|r| r.p == place.facet.p).expect("each place has its record");
        let e = look(&cache, place);
        assert!((e - own.irradiance).abs().max_element() < 1e-5 * own.irradiance.x);
    }
}

#[test]
fn a_symmetric_scene_is_lit_symmetrically() {
    let mut desc = closed_box(0.6, None);
    point_light(&mut desc, DVec3::new(0.0, 0.5, 0.0), 1.0);
    let ready = Ready::new(desc);
    let places = ready.places(Vec3::new(0.0, 0.1, 0.0), 4000, |_| true);
    let cache = fill(ready.world(), CacheSettings::default(), &places, &HitLight::Operator { caustic: &nothing });
    let (mut sums, mut worst, mut pairs) = ([0.0f64; 2], 0f32, 0);
    for place in &places {
        let mirror = |v: Vec3| Vec3::new(-v.x, v.y, v.z);
        let f = place.facet;
        let Some(other) = cache.lookup(mirror(f.p), mirror(f.n_shade), mirror(f.n_geo)) else { continue };
        let own = look(&cache, place);
        // By sides, so that the means of the two can differ.
        let [left, right] = if f.p.x < 0.0 { [own, other] } else { [other, own] };
        sums[0] += f64::from(left.x);
        sums[1] += f64::from(right.x);
        worst = worst.max((left.x - right.x).abs() / (left.x + right.x));
        pairs += 1;
    }
    assert!(pairs > 3500, "{pairs}");
    assert!((sums[0] / sums[1] - 1.0).abs() < 0.005, "{sums:?}");
    assert!(worst < 0.1, "{worst}");
}

#[test]
fn no_light_leaks_through_a_thin_wall() {
    for wall in [true, false] {
        let ready = Ready::new(two_rooms(wall));
        // Places of both rooms, mixed, so that records and surfels of both lie side by side.
        let mut places = ready.places(Vec3::new(-0.5, 0.1, 0.2), 6000, |_| true);
        places.extend(ready.places(Vec3::new(0.5, 0.1, 0.2), 6000, |_| true));
        let settings = CacheSettings { error: 0.1, ..CacheSettings::default() };
        let cache = fill(ready.world(), settings, &places, &HitLight::Operator { caustic: &nothing });
        let on_wall = |p: &Place| (p.facet.p.x - 0.0013).abs() < 1e-5 && p.facet.n_geo.x.abs() > 0.9;
        // At the very foot of the wall rounding decides on which side a place lies.
        places.retain(|p| on_wall(p) || (p.facet.p.x - 0.0013).abs() > 1e-4);
        let dark = |p: &Place| if on_wall(p) { p.facet.n_geo.x > 0.0 } else { p.facet.p.x > 0.0013 };
        let (mut leak, mut lit) = (0f32, f32::INFINITY);
        for place in &places {
            let e = look(&cache, place).x;
            if dark(place) { leak = leak.max(e) } else { lit = lit.min(e) }
        }
        if wall {
            let worst: Vec<_> = places
                .iter()
                .filter(|p| dark(p) && look(&cache, p).x > 0.0)
                .map(|p| (p.facet.p, p.facet.n_geo, look(&cache, p).x))
                .collect();
            let records = cache.records().iter().filter(|r| r.p.x > 0.01 && r.irradiance.x > 0.0);
            assert_eq!(
                leak,
                0.0,
                "{} records; {} places: {:?}",
                records.count(),
                worst.len(),
                worst.get(..worst.len().min(12))
            );
            assert!(lit > 0.01, "{lit}");
        } else {
            assert!(leak > 0.01, "the companion has light on both sides");
        }
    }
}

/// Four rooms in a row with openings that face away from each other; the lamp is in the first.
fn four_rooms() -> Description {
    let mut desc = room();
    let white = two_sided(&mut desc, 0.8);
    shape(&mut desc, GeometryDesc::Cube, DMat4::from_scale(DVec3::new(4.0, 1.0, 1.0)), white, None);
    for (x, side) in [(-2.0, 1.0), (0.0, -1.0), (2.0, 1.0)] {
        rectangle(&mut desc, DVec3::new(x, 0.0, 0.3 * side), DVec3::Y, DVec3::Z * 0.7, white, None);
    }
    point_light(&mut desc, DVec3::new(-3.2, 0.4, 0.1), 1.0);
    desc
}

#[test]
fn light_finds_its_way_through_several_rooms() {
    let ready = Ready::new(four_rooms());
    let world = ready.world();
    // Only the last room is seen: what lies before it is found by gather rays and surfels.
    let places = ready.places(Vec3::new(3.2, 0.1, -0.1), 4_000, |at| at.p.x > 2.1 && at.n_geo.y.abs() > 0.9);
    let settings = CacheSettings { gather_rays: 1024, surfel_rays: 64, light_samples: 1, ..CacheSettings::default() };
    let cache = fill(world, settings, &places, &HitLight::Operator { caustic: &nothing });
    let step = places.len() / 100;
    let (mut mean, mut expected, mut variance) = (0.0, 0.0, 0.0);
    for (k, place) in places.iter().step_by(step).enumerate() {
        mean += look(&cache, place).x;
        let (e, error) = brute_force(&world, &place.facet, 1000, k as u64);
        expected += e;
        variance += error * error;
    }
    let error = variance.sqrt() / expected;
    assert!(error < 0.05, "the test has no power: {error}");
    assert!((mean / expected - 1.0).abs() < 0.05 + 3.0 * error, "{} (deviation {error})", mean / expected);
}

#[test]
fn a_lamp_close_to_a_wall_leaves_no_blotches() {
    // Half of its light goes on from a spot that one gather ray in a few hundred meets.
    let mut desc = closed_box(0.5, None);
    point_light(&mut desc, DVec3::new(0.94, 0.2, -0.3), 1.0);
    let ready = Ready::new(desc);
    let places = ready.places(Vec3::new(-0.1, 0.2, 0.1), 600, |at| at.p.x < 0.5);
    let asked: Vec<&Place> = places.iter().step_by(places.len() / 24).collect();
    let expected: Vec<f32> = (0..).zip(&asked).map(|(k, p)| brute_force(&ready.world(), &p.facet, 6000, k).0).collect();
    // Mean of the relative errors, and the root mean square of what differs between two caches, of four.
    let measured = |guided: bool| {
        let caches: Vec<_> = [1, 2, 3, 4]
            .map(|seed| {
                let settings =
                    CacheSettings { guided, seed, surfel_cell: 0.02, error: 0.1, ..CacheSettings::default() };
                fill(ready.world(), settings, &places, &HitLight::Operator { caustic: &nothing })
            })
            .into();
        assert!(caches.iter().all(|c| (c.statistics().patches > 0) == guided));
        let seen = |c: &dualux::transport::IrradianceCache| -> Vec<f32> {
            asked.iter().zip(&expected).map(|(p, e)| look(c, p).x / e).collect()
        };
        let [a, b] = [[0, 1], [2, 3]].map(|pair| pair.map(|i| seen(&caches[i])).concat());
        let n = a.len() as f32;
        let apart = |(a, b): (&[f32], &[f32])| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
        let square = [&a, &b].map(|p| apart(p.split_at(p.len() / 2))).iter().sum::<f32>() / n;
        let mean = a.iter().chain(&b).sum::<f32>() / (2.0 * n);
        // What guided rays have found survives a file.
        let bytes = caches[0].to_bytes();
        let read = dualux::transport::IrradianceCache::from_bytes(ready.world(), &bytes).expect("a cache").cache;
        assert_eq!(read.to_bytes(), bytes);
        (mean, square.sqrt())
    };
    let ((mean, guided), (_, alone)) = (measured(true), measured(false));
    assert!((mean - 1.0).abs() < 0.04, "{mean} of what paths find");
    assert!(guided < 0.3 * alone && guided < 0.08, "{guided} with guided rays, {alone} without");
}

#[test]
fn a_finer_cache_gives_up_no_shape_that_the_one_before_served() {
    let ready = Ready::new(lit_box());
    let places = ready.places(Vec3::new(0.1, 0.2, -0.3), 600, |_| true);
    let light = HitLight::Operator { caustic: &nothing };
    let usual = fill(ready.world(), CacheSettings::default(), &places, &light);
    assert_eq!(usual.statistics().hopeless, 0);
    // So small an error that all records have the least radius, as on leaves and hair.
    let settings = CacheSettings { error: 1e-12, ..CacheSettings::default() };
    assert!(fill(ready.world(), settings, &places, &light).statistics().hopeless > 0, "it would be given up");
    let mut finer = IrradianceCache::new(ready.world(), settings);
    finer.start_as(&usual);
    finer.fill(&places, &light, usize::MAX);
    finer.finish();
    assert_eq!(finer.statistics().hopeless, 0);
    assert!(places.iter().all(|p| look(&finer, p).x > 0.0));
}
