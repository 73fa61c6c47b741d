//! What leaves a light: its power, and where it goes, held against radiometry in coordinates that the maps do not use.

use super::*;
use crate::math::stats::{chi_square_p, sidak, z_test_p};
use crate::scene::light::LightKind;
use std::f64::consts::{PI, TAU};

/// Sum of the flux of some passes over their number.
fn total(density: &dyn EmissionDensity, passes: u64) -> DVec3 {
    let one =
        |pass| -> DVec3 { (0..density.count()).filter_map(|i| density.emit(i, pass)).map(|r| r.flux.as_dvec3()).sum() };
    (0..passes).map(one).sum::<DVec3>() / passes as f64
}

#[test]
fn the_photons_of_a_pass_carry_the_power_of_the_light() {
    for (name, scene) in every_light() {
        let power = scene.lights.infos[0].power.as_dvec3();
        for sequence in [Sequence::Random, Sequence::OwenSobol] {
            for n in [1, 2, 7, 500] {
                let uniform = Uniform::new(&scene, n, sequence, 5);
                assert_eq!(uniform.count(), n, "{name}");
                if !scene.lights.is_estimated(0, &scene.shapes) {
                    let sum = total(&uniform, 2);
                    assert!((sum / power - 1.0).abs().max_element() < 1e-4, "{name}, {n}: {sum} {power}");
                }
            }
            // Textures: a mean over passes, and 1 % for what `infos` leaves out (measures other than the picture's).
            if scene.lights.is_estimated(0, &scene.shapes) && !["disk, textured", "facets, textured"].contains(&name) {
                let sum = total(&Uniform::new(&scene, 20_000, sequence, 6), 4);
                assert!((sum / power - 1.0).abs().max_element() < 0.015, "{name}: {sum} {power}");
                assert!((sum * 1.04 / power - 1.0).abs().max_element() > 0.015, "a loss of 4 % is seen");
            }
        }
    }
}

/// Four coordinates of a ray, each uniform in [0, 1) by radiometry: position by area, then cos^2 or height, and azimuth.
fn uniform_coordinates(scene: &Scene, ray: &EmittedRay) -> Vec<f64> {
    let (o, d) = (ray.o.as_dvec3(), ray.d.as_dvec3());
    // Tangent vector of any kind: azimuth is measured from it.
    let azimuth = |d: DVec3, n: DVec3| {
        let x = n.cross(DVec3::new(0.31, -0.52, 0.8)).normalize();
        d.dot(n.cross(x)).atan2(d.dot(x)) / TAU + 0.5
    };
    let cosine = |d: DVec3, n: DVec3| vec![d.dot(n).powi(2), azimuth(d, n)];
    let on_sphere = |q: DVec3, d: DVec3, side: f64| {
        let n = q.normalize();
        [vec![0.5 * (n.y + 1.0), azimuth(n, DVec3::Y)], cosine(d, side * n)].concat()
    };
    match scene.lights.kind(0) {
        crate::scene::light::LightKind::Lamp(shape) => match &scene.shapes[shape as usize].geometry {
            crate::scene::Geometry::Rectangle(r) => {
                let q = o - r.center.as_dvec3();
                let [x, y] = plane(q, r.ex.as_dvec3(), r.ey.as_dvec3());
                [vec![0.5 * (x + 1.0), 0.5 * (y + 1.0)], cosine(d, r.n.as_dvec3())].concat()
            }
            crate::scene::Geometry::Disk(k) => {
                let [x, y] = plane(o - k.center.as_dvec3(), k.ex.as_dvec3(), k.ey.as_dvec3());
                [vec![x * x + y * y, y.atan2(x) / TAU + 0.5], cosine(d, k.n.as_dvec3())].concat()
            }
            crate::scene::Geometry::Mesh(m) => {
                // The triangle whose plane is nearest.
                let area = |t: u32| f64::from(m.triangle_area(t));
                let of = |t: u32| {
                    let [a, b, c] = m.corners(t).map(|v| v.as_dvec3());
                    let n = m.face_normal(t).as_dvec3();
                    let [x, y] = plane(o - a, b - a, c - a);
                    (n.dot(o - a).abs() + (-x).max(-y).max(x + y - 1.0).max(0.0), x, y, n)
                };
                let t = if of(0).0 <= of(1).0 { 0 } else { 1 };
                let (_, x, y, n) = of(t);
                let first = area(0) / (area(0) + area(1));
                let inner = (1.0 - (1.0 - y) * (1.0 - y)).clamp(0.0, 1.0);
                let place = if t == 0 { inner * first } else { first + inner * (1.0 - first) };
                // Smooth meshes: on the dark side of the normals the opposite direction emits.
                [vec![place, x / (1.0 - y)], cosine(if n.dot(d) < 0.0 { -d } else { d }, n)].concat()
            }
            crate::scene::Geometry::Cylinder(c) => {
                let q = o - c.p0.as_dvec3();
                let axis = c.axis.as_dvec3();
                let z = q.dot(axis) / axis.length_squared();
                let n = (q - axis * z).normalize() * if c.flip { -1.0 } else { 1.0 };
                let turn = q.dot(c.binormal.as_dvec3()).atan2(q.dot(c.reference.as_dvec3())) / TAU + 0.5;
                [vec![z, turn], cosine(d, n)].concat()
            }
            crate::scene::Geometry::Sphere(s) => on_sphere(o - s.center.as_dvec3(), d, if s.flip { -1.0 } else { 1.0 }),
        },
        LightKind::Environment(_) => {
            // Where it enters the bounding sphere.
            let q = o - scene.bounds.0.as_dvec3();
            let r = f64::from(scene.bounds.1);
            let b = q.dot(d);
            let root = (b * b - q.length_squared() + r * r).max(0.0).sqrt();
            on_sphere(q + d * (-b - root), d, -1.0)
        }
        LightKind::Delta(crate::scene::light::DeltaLight::Directional { direction, .. }) => {
            let q = o - scene.bounds.0.as_dvec3();
            let n = direction.as_dvec3();
            let across = (q - n * n.dot(q)) / f64::from(scene.bounds.1);
            vec![across.length_squared(), azimuth(across, n)]
        }
        LightKind::Delta(crate::scene::light::DeltaLight::Spot { to_local, cutoff, beam, .. }) => {
            let w = to_local.as_dmat3() * d;
            let (c, b) = (f64::from(*cutoff), f64::from(*beam));
            // Share of the flux below the angle, by quadrature.
            let share = |end: f64| {
                let ramp = |t: f64| if t < b { 1.0 } else { ((c - t) / (c - b)).max(0.0) };
                (0..400).map(|i| (f64::from(i) + 0.5) / 400.0 * end).map(|t| ramp(t) * t.sin()).sum::<f64>() * end
            };
            vec![share(w.z.acos()) / share(c), w.y.atan2(w.x) / TAU + 0.5]
        }
        LightKind::Delta(_) => vec![0.5 * (d.z + 1.0), d.y.atan2(d.x) / TAU + 0.5],
    }
}

fn plane(q: DVec3, x: DVec3, y: DVec3) -> [f64; 2] {
    let n = x.cross(y);
    [q.cross(y).dot(n) / n.length_squared(), x.cross(q).dot(n) / n.length_squared()]
}

/// Chi-square p-value of coordinates that should be uniform.
fn fit(rays: impl Iterator<Item = Vec<f64>>) -> f64 {
    let (mut counts, mut n) = (Vec::new(), 0.0);
    for q in rays {
        let side = if q.len() == 4 { 5 } else { 12 };
        counts.resize(side_cells(q.len()), 0.0);
        let cell = q.iter().fold(0, |c, x| c * side + ((x.clamp(0.0, 1.0) * side as f64) as usize).min(side - 1));
        counts[cell] += 1.0;
        n += 1.0;
    }
    let expected = vec![n / counts.len() as f64; counts.len()];
    chi_square_p(&counts, &expected, 5.0)
}

fn side_cells(len: usize) -> usize {
    if len == 4 { 625 } else { 144 }
}

#[test]
fn rays_leave_as_radiometry_says() {
    let lights: Vec<_> = every_light().into_iter().filter(|(_, s)| !s.lights.is_estimated(0, &s.shapes)).collect();
    for (name, scene) in &lights {
        let uniform = Uniform::new(scene, 30_000, Sequence::Random, 9);
        let rays = || (0..uniform.count()).filter_map(|i| uniform.emit(i, 3));
        let p = fit(rays().map(|r| uniform_coordinates(scene, &r)));
        assert!(p > sidak(0.01, lights.len()), "{name}: p = {p}");
        // Companion: one coordinate (the cosine of lamps) squared once more.
        let wrong = fit(rays().map(|r| {
            let mut q = uniform_coordinates(scene, &r);
            let k = q.len() - 2;
            q[k] = q[k].powf(1.1);
            q
        }));
        assert!(wrong < 1e-3, "{name}: p = {wrong}");
    }
}

/// Textured lights, by flux: mean of a function of the ray against quadrature over the light.
#[test]
fn textured_lights_send_their_flux_where_their_pictures_say() {
    let mut tests = 0;
    let smooth = |name: &str| name.starts_with("smooth");
    for (name, scene) in every_light().into_iter().filter(|(n, s)| smooth(n) || s.lights.is_estimated(0, &s.shapes)) {
        let source = Source::new(&scene, 0);
        let f = |o: Vec3, d: DVec3| 1.0 + (o.x * 3.0).sin() as f64 + (2.0 * d.y + d.x).cos();
        // Quadrature of value / pdf over the unit cube by independent code: radiance x cos over area and solid angle.
        let reference = quadrature(&scene, &f);
        let (mut sum, mut square, n) = (0.0, 0.0, 100_000);
        for i in 0..n {
            let x = source.emit(random(11, i)).map_or(0.0, |(s, flux)| f64::from(flux.y) * f(s.o, s.d));
            sum += x;
            square += x * x;
        }
        let mean = sum / n as f64;
        let variance = (square / n as f64 - mean * mean) / n as f64;
        // Quadrature and f32 to 1e-3.
        let p = z_test_p(mean, variance + (5e-4 * reference).powi(2), reference);
        assert!(p > sidak(0.01, 6), "{name}: {mean} {reference} +- {}", variance.sqrt());
        assert!(z_test_p(mean * 1.03, variance, reference) < 1e-3, "{name}: 3 % are noticed");
        tests += 1;
    }
    assert_eq!(tests, 6);
}

fn quadrature(scene: &Scene, f: &dyn Fn(Vec3, DVec3) -> f64) -> f64 {
    use crate::scene::light::DeltaLight;
    let grid = |n: usize| (0..n).map(move |i| (i as f64 + 0.5) / n as f64);
    let sphere = |n: usize, g: &mut dyn FnMut(DVec3, f64)| {
        for c in grid(n) {
            for p in grid(2 * n) {
                let z = 2.0 * c - 1.0;
                let (s, co) = (TAU * p).sin_cos();
                let r = (1.0 - z * z).sqrt();
                g(DVec3::new(r * co, r * s, z), 2.0 * TAU / (2 * n * n) as f64);
            }
        }
    };
    let mut sum = 0.0;
    match scene.lights.kind(0) {
        LightKind::Lamp(index) => {
            let shape = &scene.shapes[index as usize];
            for prim in 0..shape.primitive_count() as u32 {
                for u in grid(40) {
                    for v in grid(40) {
                        let (at, pdf) = shape.sample_area(index, prim, Vec2::new(u as f32, v as f32));
                        let radiance = scene.textures().color(shape.emission.as_ref().unwrap(), at.uv).y;
                        let mut inner = 0.0;
                        sphere(12, &mut |w, dw| {
                            let cos = w.dot(at.n_geo.as_dvec3()).abs();
                            if w.dot(at.n_shade.as_dvec3()) > 0.0 {
                                inner += cos * dw * f(at.p, w);
                            }
                        });
                        sum += inner * f64::from(radiance) / (1600.0 * f64::from(pdf));
                    }
                }
            }
        }
        LightKind::Delta(light @ DeltaLight::Spot { position, intensity, .. }) => {
            sphere(600, &mut |w, dw| {
                let factor = light.spot_factor(scene.textures(), w.as_vec3());
                sum += f64::from(factor.y * intensity.y) * dw * f(*position, w);
            });
        }
        LightKind::Environment(environment) => {
            let (centre, r) = (scene.bounds.0.as_dvec3(), f64::from(scene.bounds.1));
            sphere(60, &mut |w, dw| {
                let radiance = f64::from(environment.radiance(&scene.images, w.as_vec3()).y);
                let x = w.any_orthonormal_vector();
                let y = w.cross(x);
                let mut inner = 0.0;
                for a in grid(16) {
                    for p in grid(32) {
                        let q = (x * (TAU * p).cos() + y * (TAU * p).sin()) * a.sqrt();
                        inner += f((centre + (q + w * environment_distance()) * r).as_vec3(), -w) / 512.0;
                    }
                }
                sum += radiance * dw * inner * PI * r * r;
            });
        }
        _ => unreachable!("lights that are estimated"),
    }
    sum
}

fn environment_distance() -> f64 {
    crate::emission::environment::AWAY
}

#[test]
fn many_lights_together_carry_all_power() {
    let ball = |x: f64, e: f32| {
        let g = GeometryDesc::Sphere { center: DVec3::new(x, 1.0, 0.0), radius: 0.1 };
        shape(g, DMat4::IDENTITY, 0, Some(Color::Constant(Vec3::splat(e))))
    };
    let mut shapes = vec![ball(0.0, 50.0), ball(1.0, 20.0), ball(2.0, 0.0)];
    shapes.extend((0..40).map(|i| ball(3.0 + f64::from(i), 0.05)));
    let all = scene(shapes, vec![]);
    let power: DVec3 = all.lights.infos.iter().map(|l| l.power.as_dvec3()).sum();
    let mut uniform = Uniform::new(&all, 300, Sequence::OwenSobol, 1);
    assert!(uniform.count() <= 301);
    let sum = total(&uniform, 20);
    // All of it is exact: photons of the tail are drawn in proportion to equal powers.
    assert!((sum / power - 1.0).abs().max_element() < 1e-4, "{sum} {power}");
    // Learned weights move photons, not power, and a floor stays.
    let mut learned = vec![0.0; all.lights.infos.len()];
    learned[1] = 1.0;
    let before = [0, 1].map(|l| uniform.light_count(l));
    uniform.set_light_weights(&learned);
    let after = [0, 1].map(|l| uniform.light_count(l));
    assert!(after[1] > 2 * before[1] && after[0] > 0 && after[0] < before[0], "{before:?} {after:?}");
    let sum = total(&uniform, 200);
    assert!((sum / power - 1.0).abs().max_element() < 0.02, "{sum} {power}");
    assert!((0..uniform.count()).filter_map(|i| uniform.emit(i, 0)).all(|r| r.light != 2), "a dark lamp sends nothing");
}

/// Cells tile the light: with parameters over [-1, 1] the volume of a photon's cell in phase space is its share of the light.
#[test]
fn spreads_have_the_volume_of_the_share() {
    for (name, scene) in every_light() {
        if name.contains("textured") || name == "envmap" || name.contains("cylinder") || name.contains("smooth") {
            continue;
        }
        for sequence in [Sequence::Random, Sequence::OwenSobol] {
            let uniform = Uniform::new(&scene, 4096, sequence, 2);
            let source = Source::new(&scene, 0);
            let (mut volume, mut count) = (0.0, 0);
            for r in (0..4096).filter_map(|i| uniform.emit(i, 0)) {
                let s = r.spread;
                let d = r.d.as_dvec3();
                let area = |v: [Vec3; 2]| 4.0 * v[0].as_dvec3().cross(v[1].as_dvec3()).dot(d).abs();
                let position = if source.has_position() { area([s.o[0], s.o[1]]) } else { 1.0 };
                let direction = if source.has_direction() { area([s.d[2], s.d[3]]) } else { 1.0 };
                volume += position * direction;
                count += 1;
            }
            // dA |cos| dw of all rays: pi A for lamps, 4 pi x pi R^2 for beams, 4 pi, or the disk.
            let whole = match name {
                "spot" => continue,
                "spot, sharp" => TAU * (1.0 - 0.7f64.cos()),
                "point" => 2.0 * TAU,
                "directional" => source.area(),
                n if n.contains("sphere") || n == "constant" => 2.0 * TAU * source.area(),
                _ => PI * source.area(),
            };
            assert_eq!(count, 4096, "{name}");
            // Clamping at rims takes a little.
            assert!((volume / whole - 1.0).abs() < 0.02, "{name} {sequence:?}: {volume} {whole}");
        }
    }
}

#[test]
fn photons_are_pure_functions_of_their_numbers() {
    let (_, scene) = every_light().swap_remove(0);
    let uniform = Uniform::new(&scene, 100, Sequence::OwenSobol, 7);
    let a: Vec<_> = (0..100).map(|i| uniform.emit(i, 4)).collect();
    let b: Vec<_> = (0..100).rev().map(|i| uniform.emit(i, 4)).collect();
    assert!(a.iter().eq(b.iter().rev()));
    assert_ne!(uniform.emit(3, 4), uniform.emit(3, 5), "passes differ");
    assert_eq!(uniform.emit(100, 0), None, "beyond the last");
}
