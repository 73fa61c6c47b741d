//! What maps show, against closed forms.

use super::*;
use crate::math::polygon::irradiance;
use crate::math::stats;
use crate::transport::photon_map::{CausticMap, Filter, GlobalMap};

const KERNELS: [Kernel; 3] = [Kernel::FOOTPRINT, Kernel::Nearest { k: 60 }, Kernel::Fixed { radius: Some(0.06) }];

fn light(n: usize, seed: u64) -> Aimed {
    let half = [Vec3::X * 1.2, Vec3::Z * 1.2];
    Aimed { o: Vec3::new(0.0, 1.0, 0.0), centre: Vec3::ZERO, half, n, seed, random: false }
}

/// Mean over `points` of the ratio of irradiance to a closed form, with its standard error over seeds.
fn ratio(
    runs: u64,
    points: &[Vec3],
    n: Vec3,
    map: impl Fn(u64) -> CausticMap,
    want: impl Fn(Vec3) -> f64,
) -> (f64, f64) {
    let means: Vec<f64> = (0..runs)
        .map(|seed| {
            let map = map(seed);
            let one = |x: &Vec3| f64::from(map.irradiance(*x, n).x) / want(*x);
            points.iter().map(one).sum::<f64>() / points.len() as f64
        })
        .collect();
    let mean = means.iter().sum::<f64>() / runs as f64;
    let var = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (runs - 1) as f64;
    (mean, (var / runs as f64).sqrt())
}

fn disk_points(count: u64, radius: f32, y: f32) -> Vec<Vec3> {
    (0..count)
        .map(|i| {
            let p = warp::sample_disk(Sampler::new(77, 0, i).next_2d()) * radius;
            Vec3::new(p.x, y, p.y)
        })
        .collect()
}

#[test]
fn a_plane_mirror_shows_its_virtual_image() {
    let mut s = empty();
    let (white, m) = (diffuse(&mut s, 0.5), add_material(&mut s, mirror()));
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 3.0), m);
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::Y * 2.0, DVec3::NEG_Y, 30.0), white);
    let room = Room::new(s);
    // The image lies one below the mirror: three below the screen.
    let want = |x: Vec3| {
        let d = (x - Vec3::NEG_Y).as_dvec3();
        d.y / d.length().powi(3)
    };
    let points = disk_points(2000, 1.0, 2.0);
    for kernel in KERNELS {
        let map = |seed| CausticMap::build(room.world(), &light(150, seed), &settings(kernel), 0);
        let (mean, error) = ratio(6, &points, Vec3::NEG_Y, map, want);
        println!("mirror, {kernel:?}: {mean:.4} +- {error:.4}");
        // Equivalence: within 1 %, at 99 % confidence (Student, 5 degrees of freedom: 4.0).
        assert!((mean - 1.0).abs() + 4.0 * error < 0.01, "{kernel:?}: {mean} +- {error}");
        let (wrong, error) = ratio(6, &points, Vec3::NEG_Y, map, |x| 1.02 * want(x));
        assert!((wrong - 1.0).abs() + 4.0 * error > 0.01, "the test has no power");
    }
}

#[test]
fn a_glass_slab_shifts_and_dims() {
    let (top, thickness, eta) = (0.5, 0.3, 1.5f64);
    let mut s = empty();
    let (white, g) = (diffuse(&mut s, 0.5), add_material(&mut s, glass(eta as f32)));
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::Y * top, DVec3::Y, 30.0), g);
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::Y * (top - thickness), DVec3::NEG_Y, 30.0), g);
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::NEG_Y, DVec3::Y, 30.0), white);
    let room = Room::new(s);
    // Where light of angle a lands after k pairs of inner reflections, and how much is left.
    let lands = |a: f64, k: i32| {
        let sin_t = a.sin() / eta;
        (2.0 - thickness) * a.tan() + f64::from(2 * k + 1) * thickness * sin_t / (1.0 - sin_t * sin_t).sqrt()
    };
    let reflectance = |a: f64| {
        let (ci, ct) = (a.cos(), (1.0 - (a.sin() / eta).powi(2)).sqrt());
        let (rs, rp) = ((ci - eta * ct) / (ci + eta * ct), (eta * ci - ct) / (eta * ci + ct));
        0.5 * (rs * rs + rp * rp)
    };
    let want = |x: Vec3| {
        let r = f64::from(x.x.hypot(x.z)).max(1e-4);
        let mut sum = 0.0;
        for k in 0..6 {
            let (mut lo, mut hi) = (0.0, 1.5);
            for _ in 0..60 {
                let mid = 0.5 * (lo + hi);
                if lands(mid, k) < r { lo = mid } else { hi = mid }
            }
            let slope = (lands(lo + 1e-6, k) - lands(lo - 1e-6, k)) / 2e-6;
            let share = (1.0 - reflectance(lo)).powi(2) * reflectance(lo).powi(2 * k);
            sum += share * lo.sin() / (r * slope);
        }
        sum
    };
    let points = disk_points(2000, 0.9, -1.0);
    for kernel in KERNELS {
        let map = |seed| CausticMap::build(room.world(), &light(150, seed), &settings(kernel), 0);
        let (mean, error) = ratio(6, &points, Vec3::Y, map, want);
        println!("slab, {kernel:?}: {mean:.4} +- {error:.4}");
        assert!((mean - 1.0).abs() + 4.0 * error < 0.01, "{kernel:?}: {mean} +- {error}");
        // Without Fresnel's losses, or with the square of the index (radiance for flux), it would fail by far.
        let (wrong, _) = ratio(2, &points, Vec3::Y, map, |x| want(x) * 2.25);
        assert!((wrong - 1.0).abs() > 0.1);
    }
}

#[test]
fn a_wall_under_a_lamp_has_the_irradiance_of_a_polygon() {
    let mut s = empty();
    let white = diffuse(&mut s, 0.5);
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 40.0), white);
    let room = Room::new(s);
    let want = |x: Vec3| {
        let v = [[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]];
        let corner = |[a, b]: [f64; 2]| DVec3::new(a, 1.0, b) - x.as_dvec3();
        irradiance(&v.map(corner), DVec3::Y).abs()
    };
    let points = disk_points(1500, 0.8, 0.0);
    for kernel in [Kernel::FOOTPRINT, Kernel::Nearest { k: 100 }, Kernel::Fixed { radius: Some(0.1) }] {
        let means: Vec<f64> = (0..6)
            .map(|seed| {
                let lamp = Lamp { centre: Vec3::Y, half: 0.5, n: 14, seed };
                let map = GlobalMap::build(room.world(), &lamp, &settings(kernel), 0, Filter::ALL);
                assert_eq!(map.irradiance(Vec3::ZERO, Vec3::Y, Filter::WITHOUT_DIRECT), Rgb::ZERO);
                let one = |x: &Vec3| f64::from(map.irradiance(*x, Vec3::Y, Filter::ALL).x) / want(*x);
                points.iter().map(one).sum::<f64>() / points.len() as f64
            })
            .collect();
        let mean = means.iter().sum::<f64>() / 6.0;
        let error = (means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / 30.0).sqrt();
        println!("lamp, {kernel:?}: {mean:.4} +- {error:.4}");
        assert!((mean - 1.0).abs() + 4.0 * error < 0.02, "{kernel:?}: {mean} +- {error}");
        assert!((mean / 1.05 - 1.0).abs() + 4.0 * error > 0.02, "the test has no power");
    }
}

/// A sphere that emits radiance 1 inwards from everywhere.
struct Shell {
    count: usize,
    seed: u64,
}

impl EmissionDensity for Shell {
    fn count(&self) -> usize {
        self.count
    }

    fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay> {
        let [a, b, c, d] = Sampler::new(self.seed, 900 + pass, index as u64).next_4d();
        let out = warp::sample_sphere([a, b].into());
        let d = crate::math::Frame::from_normal(-out).to_world(warp::sample_cosine_hemisphere([c, d].into()));
        let flux = Rgb::splat(4.0 * PI * PI / self.count as f32);
        Some(EmittedRay { o: out * (1.0 - 1e-5), d, flux, light: 0, stratum: 0, spread: Spread::default() })
    }
}

#[test]
fn a_closed_furnace_is_exact_for_isotropic_kernels() {
    for albedo in [0.3f32, 0.7] {
        let mut s = empty();
        let wall = diffuse(&mut s, albedo);
        add(&mut s, GeometryDesc::Sphere { center: DVec3::ZERO, radius: 1.0 }, DMat4::IDENTITY, wall);
        s.shapes[0].flip_normals = true;
        let room = Room::new(s);
        let want = std::f64::consts::PI / (1.0 - f64::from(albedo));
        // A radius of 0.4 of the sphere's: only chord distance and pi r^2 make that exact.
        for kernel in [Kernel::Fixed { radius: Some(0.4) }, Kernel::Nearest { k: 50 }] {
            let runs = 12;
            let means: Vec<f64> = (0..runs)
                .map(|seed| {
                    let shell = Shell { count: 20_000, seed };
                    let settings = PhotonSettings { seed, ..settings(kernel) };
                    let map = GlobalMap::build(room.world(), &shell, &settings, 0, Filter::ALL);
                    let point = |i| warp::sample_sphere(Sampler::new(seed, 5, i).next_2d());
                    let one = |x: Vec3| f64::from(map.irradiance(x, -x, Filter::ALL).x);
                    (0..100).map(|i| one(point(i))).sum::<f64>() / 100.0
                })
                .collect();
            let mean = means.iter().sum::<f64>() / runs as f64;
            let var = means.iter().map(|m| (m - mean) * (m - mean)).sum::<f64>() / (runs - 1) as f64 / runs as f64;
            println!("furnace {albedo}, {kernel:?}: {:.5} +- {:.5}", mean / want, var.sqrt() / want);
            let p = stats::z_test_p(mean, var, want);
            // Four tests share 0.01; the normal law for twelve runs: a margin of ten.
            assert!(p > stats::sidak(0.001, 4), "{kernel:?}, albedo {albedo}: {mean}, not {want} (p = {p})");
            assert!(
                stats::z_test_p(1.01 * mean, var, want) < stats::sidak(0.001, 4),
                "no power: {}",
                var.sqrt() / want
            );
        }
    }
}

#[test]
fn no_light_passes_a_thin_wall() {
    let mut s = empty();
    let white = diffuse(&mut s, 0.5);
    let both = add_material(&mut s, Material::TwoSided { front: white, back: white });
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 3.0), both);
    let room = Room::new(s);
    for kernel in KERNELS {
        let map = GlobalMap::build(room.world(), &light(80, 1), &settings(kernel), 0, Filter::ALL);
        for x in disk_points(100, 0.8, 0.0) {
            assert!(map.irradiance(x, Vec3::Y, Filter::ALL).x > 0.1, "{kernel:?}");
            for y in [0.0, -1e-4] {
                assert_eq!(map.irradiance(x + Vec3::Y * y, Vec3::NEG_Y, Filter::ALL), Rgb::ZERO, "{kernel:?}");
                assert_eq!(map.irradiance(x + Vec3::Y * y, Vec3::X, Filter::ALL), Rgb::ZERO, "{kernel:?}");
            }
        }
    }
}

#[test]
fn maps_answer_with_the_same_bits_whatever_the_threads() {
    let mut s = empty();
    let (white, m) = (diffuse(&mut s, 0.5), add_material(&mut s, mirror()));
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 3.0), m);
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::Y * 2.0, DVec3::NEG_Y, 30.0), white);
    let room = Room::new(s);
    for kernel in KERNELS {
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            let map = pool.install(|| CausticMap::build(room.world(), &light(600, 4), &settings(kernel), 3));
            assert!(map.stored() > 300_000, "enough to be built in parallel");
            disk_points(300, 1.0, 2.0).into_iter().map(|x| map.irradiance(x, Vec3::NEG_Y)).collect::<Vec<_>>()
        };
        let one = run(1);
        assert!(one.iter().all(|e| e.x > 0.0));
        assert!(one == run(2) && one == run(7), "{kernel:?}");
    }
}
