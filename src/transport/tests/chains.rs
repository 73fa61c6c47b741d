//! Footprints of whole chains against central differences of traced rays.

use super::*;
use crate::math::Mat3;
use crate::scene::mesh::MeshData;
use crate::transport::photon::{Photon, PhotonClass};
use crate::transport::photon_walk::{Goal, WalkSettings, trace};

/// One given ray as a density.
struct Single(EmittedRay);

impl EmissionDensity for Single {
    fn count(&self) -> usize {
        1
    }
    fn emit(&self, _: usize, _: u64) -> Option<EmittedRay> {
        Some(self.0)
    }
}

fn store(room: &Room, ray: EmittedRay, seed: u64) -> Vec<Photon> {
    let settings = WalkSettings { seed, most_segments: None, rr_depth: 100, goal: Goal::Classes([true, true, false]) };
    trace(room.world(), &Single(ray), &settings, 0).photons
}

/// Covariance in the tangent plane as a matrix of space, from sigma.
fn covariance(sigma: [Vec3; 2]) -> Mat3 {
    let outer = |v: Vec3| Mat3::from_cols(v * v.x, v * v.y, v * v.z);
    outer(sigma[0]) + outer(sigma[1])
}

/// The same from rays traced at both ends of each parameter's range, scaled down by `h`.
fn by_differences(room: &Room, ray: &EmittedRay, seed: u64, which: usize, h: f32) -> Option<Mat3> {
    let mut sum = Mat3::ZERO;
    for k in 0..4 {
        let end = |s: f32| {
            let o = ray.o + ray.spread.o[k] * (s * h);
            let d = (ray.d + ray.spread.d[k] * (s * h)).normalize();
            let found = store(room, EmittedRay { o, d, ..*ray }, seed);
            found.get(which).map(|p| p.p)
        };
        let g = (end(1.0)? - end(-1.0)?) / (2.0 * h);
        sum += Mat3::from_cols(g * g.x, g * g.y, g * g.z) * (1.0 / 3.0);
    }
    Some(sum)
}

/// A bumpy mirror with smooth normals: a grid over `[-1, 1]^2`.
fn dented_mirror() -> GeometryDesc {
    let n = 24u32;
    let mut data = MeshData::default();
    for j in 0..=n {
        for i in 0..=n {
            let (x, z) = (i as f32 / n as f32 * 2.0 - 1.0, j as f32 / n as f32 * 2.0 - 1.0);
            data.positions.push(Vec3::new(x, 0.1 * (2.0 * x).cos() * (1.5 * z).cos(), z));
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            data.triangles.push([a, a + n + 1, a + 1]);
            data.triangles.push([a + 1, a + n + 1, a + n + 2]);
        }
    }
    GeometryDesc::Mesh(data)
}

/// Lamp above, `specular` below, screens all around.
fn chamber(specular: impl FnOnce(&mut Description)) -> Room {
    let mut scene = empty();
    let white = diffuse(&mut scene, 0.5);
    for (c, n) in [(DVec3::NEG_Y, DVec3::Y), (DVec3::X, DVec3::NEG_X), (DVec3::NEG_X, DVec3::X)] {
        add(&mut scene, GeometryDesc::Rectangle, square(c * 4.0, n + DVec3::new(0.1, 0.0, 0.2), 40.0), white);
    }
    for (c, n) in [(DVec3::Y, DVec3::NEG_Y), (DVec3::Z, DVec3::NEG_Z), (DVec3::NEG_Z, DVec3::Z)] {
        add(&mut scene, GeometryDesc::Rectangle, square(c * 4.0, n, 40.0), white);
    }
    specular(&mut scene);
    Room::new(scene)
}

fn check(name: &str, room: &Room, rays: impl Fn(u64) -> EmittedRay, tolerance: f32) {
    let fresnel = !name.contains("mirror");
    let mut errors = Vec::new();
    for seed in 0..400 {
        let ray = rays(seed);
        let stored = store(room, ray, seed);
        // The random numbers are the same for neighbours, so they take the same turns.
        for (which, photon) in stored.iter().enumerate().filter(|(_, p)| p.class == PhotonClass::Caustic) {
            let Some(want) = by_differences(room, &ray, seed, which, 0.02) else { continue };
            let got = covariance(photon.sigma);
            let size = |m: &Mat3| m.to_cols_array().iter().map(|x| x * x).sum::<f32>().sqrt();
            // Where a Fresnel coin is thrown footprints are widened; their shape and the least size are known.
            let widened = size(&got) / size(&want);
            assert!(widened > 0.9 && (fresnel || widened < 1.1), "{name}: {widened}");
            errors.push(size(&(got * (1.0 / widened) - want)) / size(&want));
        }
    }
    errors.sort_by(f32::total_cmp);
    let (n, typical, most) = (errors.len(), errors[errors.len() / 2], errors[errors.len() * 9 / 10]);
    println!("{name}: {n} chains, relative error of Sigma: median {typical:.1e}, 90 % below {most:.1e}");
    assert!(n > 100, "{name}: {n}");
    assert!(typical < 0.2 * tolerance && most < tolerance, "{name}: {typical} {most}");
}

fn point_rays(seed: u64) -> EmittedRay {
    let u = Sampler::new(seed, 5, 0).next_4d();
    let light = Aimed {
        o: Vec3::new(0.3, 2.0, 0.1),
        centre: Vec3::ZERO,
        half: [Vec3::new(0.8, 0.1, 0.0), Vec3::new(0.0, 0.0, 0.7)],
        n: 40,
        seed,
        random: false,
    };
    light.ray([2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0])
}

fn lamp_rays(seed: u64) -> EmittedRay {
    let mut ray = point_rays(seed);
    let u = Sampler::new(seed, 6, 0).next_4d();
    ray.spread.d = [Vec3::ZERO, Vec3::ZERO, ray.spread.d[0], ray.spread.d[1]];
    ray.spread.o = [Vec3::X * 0.02, Vec3::Z * (0.01 + 0.01 * u[0]), Vec3::ZERO, Vec3::ZERO];
    ray
}

#[test]
fn footprints_behind_mirrors_and_glass_agree_with_traced_neighbours() {
    let flat = chamber(|s| {
        let m = add_material(s, mirror());
        add(s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::new(0.3, 1.0, -0.2), 2.0), m);
    });
    let ball = chamber(|s| {
        let m = add_material(s, glass(1.5));
        add(s, GeometryDesc::Sphere { center: DVec3::new(0.0, -0.5, 0.0), radius: 1.0 }, DMat4::IDENTITY, m);
    });
    let dented = chamber(|s| {
        let m = add_material(
            s,
            Material::TwoSided { front: s.materials.len() as u32 + 1, back: s.materials.len() as u32 + 1 },
        );
        add_material(s, mirror());
        add(s, dented_mirror(), DMat4::IDENTITY, m);
    });
    let pane = chamber(|s| {
        let m = add_material(s, glass(1.5));
        add(s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 2.0), m);
        add(s, GeometryDesc::Rectangle, square(DVec3::NEG_Y * 0.3, DVec3::NEG_Y, 2.0), m);
    });
    for (name, room, tolerance) in
        [("mirror", &flat, 2e-2), ("ball", &ball, 5e-2), ("dented mirror", &dented, 5e-2), ("slab", &pane, 2e-2)]
    {
        check(&format!("{name}, point"), room, point_rays, tolerance);
        check(&format!("{name}, lamp"), room, lamp_rays, tolerance);
    }
}

#[test]
fn photons_that_few_neighbours_accompany_have_wider_footprints() {
    // A pane: what it reflects once has the share R of its neighbours, what it lets through (1 - R)^2 at the least.
    let pane = chamber(|s| {
        let m = add_material(s, glass(1.5));
        add(s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 2.0), m);
    });
    let plain = chamber(|s| {
        let m = add_material(s, mirror());
        add(s, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 2.0), m);
    });
    let area = |room: &Room, ray, seed| {
        let found = store(room, ray, seed).into_iter().find(|p| p.p.y > 3.0 && p.class == PhotonClass::Caustic)?;
        Some(found.sigma[0].length() * found.sigma[1].length())
    };
    let mut seen = 0;
    for seed in 0..600 {
        let ray = point_rays(seed);
        let (Some(pane), Some(plain)) = (area(&pane, ray, seed), area(&plain, ray, seed)) else { continue };
        let r = {
            let (ci, eta) = (f64::from(-ray.d.y), 1.5f64);
            let ct = (1.0 - (1.0 - ci * ci) / (eta * eta)).sqrt();
            let (rs, rp) = ((ci - eta * ct) / (ci + eta * ct), (eta * ci - ct) / (eta * ci + ct));
            0.5 * (rs * rs + rp * rp)
        };
        assert!((f64::from(pane / plain) * r - 1.0).abs() < 0.01, "{} {r}", pane / plain);
        seen += 1;
    }
    assert!(seen > 10, "{seen}");
}
