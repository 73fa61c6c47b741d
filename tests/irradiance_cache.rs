//! The irradiance cache against closed forms and brute force.

mod common;

use common::*;
use dualux::accel::Accel;
use dualux::math::sampler::hash;
use dualux::math::{DMat4, DVec3, Frame, Rgb, Sampler, Vec3, warp};
use dualux::scene::description::*;
use dualux::scene::{Color, Description, Material, Scene, SurfacePoint};
use dualux::transport::gather_ray::RayCounts;
use dualux::transport::surfel_direct::direct_irradiance;
use dualux::transport::surfels::Facet;
use dualux::transport::{CacheSettings, HitLight, IrradianceCache, Place, World};
use std::f32::consts::PI;

struct Ready {
    scene: Scene,
    accel: Accel,
}

impl Ready {
    fn new(desc: Description) -> Self {
        let scene = Scene::new(desc).expect("the scene is valid");
        let accel = Accel::new(&scene.shapes);
        Ready { scene, accel }
    }

    fn world(&self) -> World<'_> {
        World::new(&self.scene, &self.accel)
    }

    /// Places by `n` rays from `eye` in all directions, of those within `keep`.
    fn places(&self, eye: Vec3, n: u64, keep: impl Fn(&SurfacePoint) -> bool) -> Vec<Place> {
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

fn room() -> Description {
    empty_scene(DVec3::new(0.0, 0.0, -0.9), DVec3::ZERO, 8, 8)
}

/// A rectangle with the half edges `ex`, `ey` around `center`; its normal is their cross product.
fn rectangle(
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

fn two_sided(scene: &mut Description, albedo: f32) -> MaterialId {
    let side = diffuse(scene, albedo);
    material(scene, Material::TwoSided { front: side, back: side })
}

/// A closed box `[-1,1]^3` of diffuse walls.
fn closed_box(albedo: f32, emission: Option<f32>) -> Description {
    let mut scene = room();
    let wall = diffuse(&mut scene, albedo);
    shape(&mut scene, GeometryDesc::Cube, DMat4::IDENTITY, wall, emission);
    scene.shapes[0].flip_normals = true;
    scene
}

fn point_light(scene: &mut Description, position: DVec3, intensity: f32) {
    scene.lights.push(LightDesc::Point { position, intensity: Rgb::splat(intensity) });
}

fn nothing(_: Vec3, _: Vec3) -> Rgb {
    Rgb::ZERO
}

fn fill<'a>(world: World<'a>, settings: CacheSettings, places: &[Place], light: &HitLight) -> IrradianceCache<'a> {
    let mut cache = IrradianceCache::new(world, settings);
    cache.fill(places, light, usize::MAX);
    cache.finish();
    cache
}

fn look(cache: &IrradianceCache, place: &Place) -> Rgb {
    let f = place.facet;
    cache.lookup(f.p, f.n_shade, f.n_geo).expect("the place is covered")
}

/// Indirect irradiance by `paths` paths, mean and standard error.
fn brute_force(world: &World, at: &Facet, paths: u64, key: u64) -> (f32, f32) {
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

/// A box lit by a point light, white but for one dark wall.
fn lit_box() -> Description {
    let mut desc = closed_box(0.6, None);
    point_light(&mut desc, DVec3::new(0.2, 0.4, 0.1), 1.0);
    desc
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

/// Two rooms side by side, with a wall without thickness between them; the lamp is in the left one.
fn two_rooms(wall: bool) -> Description {
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
        let facet = Facet { p: record.p, p_error: Vec3::splat(1e-6), n_geo: record.frame.n, n_shade: record.frame.n };
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
    cache.refine(0.01);
    cache.fill(&places, &light, 50);
    assert_eq!(cache.records().len(), before.len() + 50, "no more than allowed");
    assert!(cache.statistics().left > 0);
    cache.fill(&places, &light, usize::MAX);
    assert!(cache.records().len() > before.len() + 100);
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
