//! The walk: ledger, classes, limits, determinism.

use super::*;
use crate::transport::photon::PhotonClass;
use crate::transport::photon_walk::{Goal, Traced, WalkSettings, trace};

fn walk(room: &Room, density: &dyn EmissionDensity, goal: Goal, most_segments: Option<u32>) -> Traced {
    trace(room.world(), density, &WalkSettings { seed: 3, most_segments, rr_depth: 5, goal }, 0)
}

const ALL: Goal = Goal::Classes([true; 3]);

/// Rough plastic over a diffuse base.
fn coat(base: Rgb, alpha: f32) -> Material {
    Material::RoughPlastic {
        eta: 1.5,
        diffuse_reflectance: Color::Constant(base),
        specular_reflectance: Color::Constant(Rgb::ONE),
        nonlinear: false,
        roughness: crate::scene::material::Roughness {
            distribution: crate::scene::material::Distribution::Ggx,
            alpha_u: crate::scene::Scalar::Constant(alpha),
            alpha_v: crate::scene::Scalar::Constant(alpha),
        },
    }
}

/// A room with all kinds of surfaces, open on one side.
fn workshop() -> Room {
    let mut s = empty();
    let white = diffuse(&mut s, 0.7);
    let m = [mirror(), glass(1.5)].map(|m| add_material(&mut s, m));
    let sharp = add_material(&mut s, coat(Rgb::new(0.5, 0.3, 0.1), 0.01));
    let dull = add_material(&mut s, coat(Rgb::new(0.5, 0.3, 0.1), 0.3));
    let mask = Material::Mask { opacity: crate::scene::Scalar::Constant(0.5), nested: white };
    let mask = add_material(&mut s, mask);
    let walls = [
        (DVec3::NEG_Y, DVec3::Y, sharp),
        (DVec3::NEG_X, DVec3::X, white),
        (DVec3::X, DVec3::NEG_X, dull),
        (DVec3::NEG_Z, DVec3::Z, white),
        (DVec3::Y * 3.0, DVec3::NEG_Y, white),
    ];
    for (c, n, material) in walls {
        add(&mut s, GeometryDesc::Rectangle, square(c, n, 4.0), material);
    }
    add(&mut s, GeometryDesc::Sphere { center: DVec3::new(-0.5, 0.0, 0.0), radius: 0.4 }, DMat4::IDENTITY, m[0]);
    add(&mut s, GeometryDesc::Sphere { center: DVec3::new(0.5, 0.2, 0.3), radius: 0.4 }, DMat4::IDENTITY, m[1]);
    add(&mut s, GeometryDesc::Rectangle, square(DVec3::new(0.0, 1.0, 0.0), DVec3::Y, 0.5), mask);
    Room::new(s)
}

fn aimed(n: usize) -> Aimed {
    let half = [Vec3::X * 1.5, Vec3::Z * 1.5];
    Aimed { o: Vec3::new(0.0, 2.0, 0.0), centre: Vec3::ZERO, half, n, seed: 1, random: false }
}

#[test]
fn the_ledger_closes_and_roulette_is_fair() {
    let room = workshop();
    for goal in [ALL, Goal::Caustics] {
        for most in [None, Some(1), Some(2), Some(5)] {
            let traced = walk(&room, &aimed(100), goal, most);
            let total = traced.ledger.total();
            assert_eq!(total.photons, 10_000);
            assert!(total.imbalance() < 1e-6, "{goal:?} {most:?}: {}", total.imbalance());
            assert!(total.emitted.x > 0.0 && total.absorbed.x > 0.0);
            let stored: u64 = total.stored.iter().sum();
            assert_eq!(stored, traced.photons.len() as u64);
            assert!(traced.photons.iter().all(|p| most.is_none_or(|m| p.segments <= m)));
            if goal == Goal::Caustics {
                assert!(total.handed_on.x > 0.0 || most == Some(1));
                assert!(traced.photons.iter().all(|p| p.class == PhotonClass::Caustic && p.segments > 1));
            } else {
                assert_eq!(total.handed_on.x, 0.0);
                assert_eq!(traced.photons.iter().any(|p| p.class == PhotonClass::Indirect), most != Some(1));
            }
            // 10,000 coins: the net of roulette is zero within some per cent of the light that met it.
            assert!(total.roulette.abs().max_element() < 0.03 * total.emitted.x, "{}", total.roulette);
            assert_eq!(total.truncated.x > 0.0, most.is_some(), "{most:?}");
        }
    }
}

#[test]
fn reflected_photons_are_those_indirect_ones_that_the_rest_of_a_material_scattered_last() {
    let room = workshop();
    let of = |goal| walk(&room, &aimed(60), goal, None).photons;
    let (reflected, indirect) = (of(Goal::Reflected), of(Goal::Classes([false, false, true])));
    // The way back meets a surface with a rest, or a mask, which photons pass.
    let scene = &room.scene;
    let from_rest = |p: &crate::transport::photon::Photon| {
        let ray = crate::accel::Ray { o: p.p, d: p.wi, tmin: 1e-4, tmax: f32::INFINITY };
        let hit = room.accel.closest(&ray).filter(|hit| !room.world().passes_light(hit.shape))?;
        let material = scene.shapes[hit.shape as usize].material;
        Some(crate::scene::material::has_sharp_lobe(&scene.materials, material, f32::INFINITY))
    };
    assert!(reflected.len() > 500, "{}", reflected.len());
    let wrong = reflected.iter().filter(|p| from_rest(p) == Some(false)).count();
    assert!(wrong * 100 < reflected.len(), "{wrong} of {}", reflected.len());
    // One after the other they are found among the indirect photons, and the others come from diffuse parts: some of them from plain ones.
    let mut rest = reflected.iter().peekable();
    let others: Vec<_> = indirect.iter().filter(|p| rest.next_if(|r| r == p).is_none()).collect();
    assert!(rest.next().is_none() && others.len() + reflected.len() == indirect.len());
    let plain = others.iter().filter(|p| from_rest(p) == Some(false)).count();
    assert!(plain * 4 > others.len(), "the test can tell: {plain} of {}", others.len());
    let plain = {
        let mut s = empty();
        let white = diffuse(&mut s, 0.7);
        add(&mut s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 3.0), white);
        add(&mut s, GeometryDesc::Rectangle, square(DVec3::Y * 4.0, DVec3::NEG_Y, 30.0), white);
        walk(&Room::new(s), &aimed(20), Goal::Reflected, None)
    };
    assert!(plain.photons.is_empty() && plain.ledger.total().imbalance() < 1e-6);
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let room = workshop();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| walk(&room, &aimed(120), ALL, None))
    };
    let one = run(1);
    assert!(one.photons.len() > 10_000);
    for threads in [2, 7] {
        let other = run(threads);
        assert!(one.photons == other.photons, "{threads} threads");
        assert_eq!(one.ledger, other.ledger);
    }
}

#[test]
fn roughness_decides_on_both_sides_of_the_threshold() {
    let lit = |alpha: f32, blend: bool| {
        let mut s = empty();
        let white = diffuse(&mut s, 0.5);
        let metal = Material::RoughConductor {
            eta: Color::Constant(Rgb::ZERO),
            k: Color::Constant(Rgb::ONE),
            specular_reflectance: Color::Constant(Rgb::ONE),
            roughness: crate::scene::material::Roughness {
                distribution: crate::scene::material::Distribution::Beckmann,
                alpha_u: crate::scene::Scalar::Constant(alpha),
                alpha_v: crate::scene::Scalar::Constant(alpha),
            },
        };
        let mut metal = add_material(&mut s, metal);
        if blend {
            let (first, weight) = (add_material(&mut s, mirror()), crate::scene::Scalar::Constant(0.5));
            metal = add_material(&mut s, Material::Blend { weight, first, second: metal, absorbed: 0.0 });
        }
        add(&mut s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 3.0), metal);
        add(&mut s, GeometryDesc::Rectangle, square(DVec3::Y * 4.0, DVec3::NEG_Y, 30.0), white);
        let traced = walk(&Room::new(s), &aimed(20), ALL, Some(2));
        let of = |class| traced.photons.iter().filter(|p| p.class == class).count();
        (of(PhotonClass::Caustic), of(PhotonClass::Indirect))
    };
    let threshold = crate::transport::NEARLY_SPECULAR_ALPHA;
    let (below, above) = (lit(threshold * 0.99, false), lit(threshold * 1.01, false));
    assert!(below.0 > 300 && below.1 == 0, "{below:?}");
    assert!(above.0 == 0 && above.1 > 300, "{above:?}");
    // Half mirror, half rough: each lobe by its own roughness.
    let blend = lit(threshold * 1.01, true);
    assert!(blend.0 > 120 && blend.1 > 120, "{blend:?}");
}

#[test]
fn a_point_light_has_two_parameters_wherever_they_stand() {
    /// The same rays with their derivatives in the last two places.
    struct Moved(Aimed);
    impl EmissionDensity for Moved {
        fn count(&self) -> usize {
            self.0.count()
        }
        fn emit(&self, index: usize, pass: u64) -> Option<EmittedRay> {
            let mut ray = self.0.emit(index, pass)?;
            ray.spread.d.rotate_right(2);
            Some(ray)
        }
    }
    let room = workshop();
    let (first, last) = (walk(&room, &aimed(20), ALL, Some(3)), walk(&room, &Moved(aimed(20)), ALL, Some(3)));
    assert!(first.photons == last.photons);
    assert!(first.photons.iter().filter(|p| p.class != PhotonClass::Indirect).all(|p| p.parameters == 2));
}

#[test]
fn a_coat_of_little_roughness_throws_the_caustic_of_a_smooth_one() {
    // Light on a coated floor, its caustic on the ceiling: smooth, or of roughness 0.01, which blurs next to nothing.
    let ceiling = |coat: Material| {
        let mut s = empty();
        let white = diffuse(&mut s, 0.5);
        let coat = add_material(&mut s, coat);
        add(&mut s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 3.0), coat);
        add(&mut s, GeometryDesc::Rectangle, square(DVec3::Y * 4.0, DVec3::NEG_Y, 30.0), white);
        let traced = walk(&Room::new(s), &aimed(150), Goal::Caustics, None);
        assert!(traced.ledger.total().imbalance() < 1e-6);
        assert!(traced.photons.iter().all(|p| p.segments == 2 && p.sigma[0].is_finite()));
        let flux: f32 = traced.photons.iter().map(|p| p.flux.x).sum();
        let mean: Vec3 = traced.photons.iter().map(|p| p.p * p.flux.x).sum::<Vec3>() / flux;
        let size = |p: &crate::transport::photon::Photon| f64::from(p.sigma[0].length() * p.sigma[1].length()).sqrt();
        (flux, mean, traced.photons.iter().map(size).sum::<f64>() / traced.photons.len() as f64)
    };
    let c = |x: f32| Color::Constant(Rgb::splat(x));
    let smooth =
        Material::Plastic { eta: 1.5, diffuse_reflectance: c(0.4), specular_reflectance: c(1.0), nonlinear: false };
    let (smooth, sharp, dull) =
        (ceiling(smooth), ceiling(coat(Rgb::splat(0.4), 0.01)), ceiling(coat(Rgb::splat(0.4), 0.09)));
    assert!((sharp.0 / smooth.0 - 1.0).abs() < 0.05, "{} {}", sharp.0, smooth.0);
    assert!((sharp.1 - smooth.1).length() < 0.1);
    // Roughness inflates footprints.
    assert!(sharp.2 > smooth.2 && dull.2 > 2.0 * sharp.2);
}

#[test]
fn point_clouds_hold_every_photon() {
    let photons = walk(&workshop(), &aimed(10), ALL, None).photons;
    let mut file = Vec::new();
    crate::transport::photon_ply::write_ply(&mut file, &photons).expect("written to memory");
    let end = b"end_header\n";
    let header = file.windows(end.len()).position(|w| w == end).expect("a header") + end.len();
    let text = std::str::from_utf8(&file[..header]).expect("text");
    assert!(text.contains(&format!("element vertex {}\n", photons.len())));
    assert_eq!(text.matches("property float").count(), 18);
    let record = 18 * 4 + 3 * 4 + 1;
    assert_eq!(file.len() - header, photons.len() * record);
    let last = &file[file.len() - record..];
    let number = |k: usize| f32::from_le_bytes(last[4 * k..4 * k + 4].try_into().expect("four bytes"));
    let photon = photons.last().expect("photons");
    assert_eq!([number(0), number(9), number(17)], [photon.p.x, photon.flux.x, photon.sigma[1].z]);
    assert_eq!(last[record - 1], photon.class as u8);
}
