//! All lights together: irradiance in closed form, selection, powers, sides of emission.

use super::*;
use crate::math::polygon::irradiance;
use crate::math::stats::{sidak, z_test_p};
use crate::scene::texture::{TexFilter, Wrap};
use std::f64::consts::PI;

fn scene() -> (Vec<Shape>, Vec<LightDesc>) {
    let up = [[[2.0, 0.0, 2.0], [2.0, 1.0, 2.2], [3.0, 0.5, 2.5]], [[2.0, 1.0, 2.2], [2.5, 1.5, 3.0], [3.0, 0.5, 2.5]]];
    let shapes = vec![
        ceiling(DVec3::new(0.2, 0.1, 2.0), 0.5, 3.0),
        lamp(triangles(&up, vec![]), DMat4::IDENTITY, false, Rgb::splat(2.0)),
        sphere(DVec3::new(-1.0, 2.0, 3.0), 0.4, false, 5.0),
        lamp(
            GeometryDesc::Disk,
            DMat4::from_translation(DVec3::new(0.0, 0.0, 1.0))
                * DMat4::from_rotation_x(PI)
                * DMat4::from_scale(DVec3::splat(0.3)),
            false,
            Rgb::ONE,
        ),
    ];
    let others = vec![
        LightDesc::Point { position: DVec3::new(1.0, 1.0, 2.0), intensity: Rgb::splat(2.5) },
        LightDesc::Directional { direction: DVec3::new(0.3, 0.0, -2.0), irradiance: Rgb::splat(0.4) },
        LightDesc::Constant { radiance: Rgb::splat(0.1) },
    ];
    (shapes, others)
}

/// Irradiance at the origin on a plane that faces +z.
fn closed_form() -> f64 {
    let v = DVec3::new;
    let rectangle = [v(-0.3, -0.4, 2.0), v(0.7, -0.4, 2.0), v(0.7, 0.6, 2.0), v(-0.3, 0.6, 2.0)];
    let quad = [v(2.0, 0.0, 2.0), v(2.0, 1.0, 2.2), v(2.5, 1.5, 3.0), v(3.0, 0.5, 2.5)];
    let two = [vec![quad[0], quad[1], quad[3]], vec![quad[1], quad[2], quad[3]]];
    let center = v(-1.0, 2.0, 3.0);
    let sphere = PI * 5.0 * 0.4 * 0.4 / center.length_squared() * center.z / center.length();
    let disk = PI * 0.3 * 0.3 / (0.3 * 0.3 + 1.0);
    let point = 2.5 / 6.0 * 2.0 / 6f64.sqrt();
    let parallel = 0.4 * 2.0 / (4.0f64 + 0.09).sqrt();
    3.0 * irradiance(&rectangle, DVec3::Z)
        + 2.0 * two.iter().map(|t| irradiance(t, DVec3::Z)).sum::<f64>()
        + sphere
        + disk
        + point
        + parallel
        + 0.1 * PI
}

/// Mean and variance of the mean of weight x cos over `count` samples at the origin.
fn estimate(all: &Lights, shapes: &[Shape], count: u64, weigh: impl Fn(&LightSample) -> f64) -> (f64, f64) {
    let (mut sum, mut square) = (0.0, 0.0);
    for i in 0..count {
        if let Some(s) = all.sample(shapes, NO_TEXTURES, Vec3::ZERO, random(8, i, 0), random2(8, i)) {
            let value = s.weight.x as f64 * s.wi.z.max(0.0) as f64 * weigh(&s);
            sum += value;
            square += value * value;
        }
    }
    let mean = sum / count as f64;
    (mean, (square / count as f64 - mean * mean) / count as f64)
}

#[test]
fn irradiance_of_all_lights_together_is_the_closed_form() {
    let (shapes, others) = scene();
    // A small bounding sphere, so that the lights at infinity do not take all samples.
    let all = Lights::new(&shapes, &others, &[], &[], (Vec3::ZERO, 1.0));
    let (mean, variance) = estimate(&all, &shapes, 400_000, |_| 1.0);
    let reference = closed_form();
    let p = z_test_p(mean, variance, reference);
    assert!(p > 0.01, "{mean} +- {} against {reference}: p = {p}", variance.sqrt());
    // Companions: an error of 3 %, and one lamp of seven left out.
    assert!(z_test_p(mean * 1.03, variance, reference) < 0.01);
    let (mean, variance) = estimate(&all, &shapes, 400_000, |s| if s.light == 1 { 0.0 } else { 1.0 });
    let p = z_test_p(mean, variance, reference);
    assert!(p < 1e-3, "{mean} +- {}: p = {p}", variance.sqrt());
}

#[test]
fn each_lamp_alone_is_the_closed_form_too() {
    let v = DVec3::new;
    let rectangle = [v(-0.3, -0.4, 2.0), v(0.7, -0.4, 2.0), v(0.7, 0.6, 2.0), v(-0.3, 0.6, 2.0)];
    let low = [v(-3.0, 1.0, -1.0), v(-3.0, 1.0, 2.0), v(2.0, 1.0, 2.0), v(2.0, 1.0, -1.0)]; // crosses the horizon
    let wall = DMat4::from_translation(v(-0.5, 1.0, 0.5))
        * DMat4::from_rotation_x(PI / 2.0)
        * DMat4::from_scale(v(2.5, 1.5, 1.0));
    let cases = [
        (ceiling(v(0.2, 0.1, 2.0), 0.5, 1.0), irradiance(&rectangle, DVec3::Z)),
        (lamp(GeometryDesc::Rectangle, wall, false, Rgb::ONE), irradiance(&low, DVec3::Z)),
        (sphere(v(0.0, 0.0, 3.0), 2.9, false, 1.0), PI * (2.9f64 / 3.0).powi(2)),
        (sphere(v(0.0, 0.0, 3e4), 2.0, false, 1.0), PI * (2.0f64 / 3e4).powi(2)),
        (sphere(v(0.1, 0.2, 0.3), 2.0, true, 1.0), PI), // inside: every direction is bright
    ];
    let count = cases.len();
    for (k, (shape, reference)) in cases.into_iter().enumerate() {
        let shapes = [shape];
        let (mean, variance) = estimate(&lights(&shapes, &[]), &shapes, 50_000, |_| 1.0);
        let p = z_test_p(mean, variance + (1e-6 * mean).powi(2), reference);
        assert!(p > sidak(0.01, count), "{k}: {mean} +- {} against {reference}", variance.sqrt());
        assert!(z_test_p(mean * 1.05, variance, reference) < 1e-3, "{k}: power");
    }
}

#[test]
fn a_lamp_point_found_has_the_density_of_the_sample() {
    let (shapes, others) = scene();
    let all = lights(&shapes, &others);
    let mut seen = [0; 7];
    for i in 0..20_000 {
        let p = Vec3::new(0.1, -0.2, 0.3) * (i % 3) as f32;
        let Some(s) = all.sample(&shapes, NO_TEXTURES, p, random(9, i, 0), random2(9, i)) else {
            continue;
        };
        seen[s.light as usize] += 1;
        match all.infos[s.light as usize].kind.as_str() {
            "point" | "directional" => assert_eq!(s.pdf_dir, 0.0),
            "constant" => assert_eq!(all.pdf_dir_environment(s.wi), s.pdf_dir),
            _ => {
                // The primitives of the lamp that the ray can have met: for one of them the density is the sample's.
                let shape = &shapes[s.light as usize];
                let reached = p + s.wi * s.distance;
                let same = (0..shape.primitive_count() as u32).any(|prim| {
                    let (u, v) = match &shape.geometry {
                        Geometry::Mesh(m) => barycentric(m.corners(prim), reached),
                        _ => (0.0, 0.0),
                    };
                    let at = shape.surface_point(s.light, prim, p, s.wi, ShapeHit { t: s.distance, u, v });
                    let back = all.pdf_dir_surface(&shapes, p, &at);
                    let weight = all.emitted(&shapes, NO_TEXTURES, &at, -s.wi) / s.pdf_dir;
                    assert!((weight / s.weight - 1.0).abs().max_element() < 1e-6);
                    (back / s.pdf_dir - 1.0).abs() < 1e-4
                });
                assert!(same, "{s:?}");
            }
        }
    }
    assert!(seen.iter().all(|&n| n > 20), "every light is drawn: {seen:?}");
}

fn barycentric([a, b, c]: [Vec3; 3], p: Vec3) -> (f32, f32) {
    let n = (b - a).cross(c - a);
    let q = p - a;
    (q.cross(c - a).dot(n) / n.length_squared(), (b - a).cross(q).dot(n) / n.length_squared())
}

#[test]
fn infos_name_the_lights_and_their_power() {
    let (shapes, others) = scene();
    let all = lights(&shapes, &others);
    let kinds: Vec<&str> = all.infos.iter().map(|i| i.kind.as_str()).collect();
    let expected =
        ["area (rectangle)", "area (mesh)", "area (sphere)", "area (disk)", "point", "directional", "constant"];
    assert_eq!(kinds, expected);
    let power = |k: usize| all.infos[k].power.x as f64;
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-5;
    assert!(near(power(0), PI * 3.0) && near(power(2), PI * 5.0 * 4.0 * PI * 0.16));
    assert!(near(power(4), 4.0 * PI * 2.5) && near(power(5), PI * 100.0 * 0.4));
    assert!(near(power(6), 4.0 * PI * PI * 100.0 * 0.1));
    assert_eq!(all.infos[1].primitives, 2);
    assert!(!all.is_delta_only() && !all.is_empty());
    assert!(lights(&[], &others[..2]).is_delta_only() && lights(&[], &[]).is_empty());
}

#[test]
fn no_light_never_samples_and_dark_lamps_never_send() {
    let none = lights(&[], &[]);
    assert!(none.sample(&[], NO_TEXTURES, Vec3::ZERO, 0.5, Vec2::splat(0.5)).is_none());
    assert_eq!(none.environment(NO_TEXTURES, Vec3::X), Rgb::ZERO);
    let black = [ceiling(DVec3::Z, 1.0, 0.0), ceiling(DVec3::Z, 1.0, f32::NAN), ceiling(DVec3::Z, 1.0, 1.0)];
    let all = lights(&black, &[]);
    let drawn: Vec<u32> = (0..1000)
        .filter_map(|i| all.sample(&black, NO_TEXTURES, Vec3::ZERO, random(1, i, 0), random2(1, i)))
        .filter(|s| s.weight.is_finite())
        .map(|s| s.light)
        .collect();
    assert!(drawn.len() > 990 && drawn.iter().all(|&l| l == 2));
}

#[test]
fn weak_lamps_keep_the_floor_and_thousands_follow_their_power() {
    let mut shapes: Vec<Shape> =
        (0..3000).map(|i| ceiling(DVec3::new(i as f64, 0.0, 2.0), 0.1, 1.0 + (i % 5) as f32)).collect();
    shapes.push(ceiling(DVec3::new(0.0, 3.0, 2.0), 0.1, 1e-9));
    let all = lights(&shapes, &[]);
    let total: f64 = all.infos.iter().map(|i| i.power.x as f64).sum();
    for k in [0usize, 1, 2, 3, 4, 2999] {
        let p = all.table.pmf(k) as f64;
        assert!((p / (all.infos[k].power.x as f64 / total) - 1.0).abs() < 1e-3);
    }
    let weak = all.table.pmf(3000) as f64 * 3001.0;
    assert!((weak / FLOOR - 1.0).abs() < 1e-2, "{weak}");
}

#[test]
fn the_interpolated_normal_decides_the_side() {
    let corners = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]];
    // Normals that lean far to +x: from (0.1, 0.1, small) they point away, from the back side at x > 0 they face it.
    let lean = Vec3::new(1.0, 0.0, 0.1).normalize();
    let shapes = [lamp(triangles(&corners, vec![lean; 3]), DMat4::IDENTITY, false, Rgb::ONE)];
    let all = lights(&shapes, &[]);
    let seen = |p: Vec3| all.sample(&shapes, NO_TEXTURES, p, 0.5, Vec2::splat(0.4));
    assert!(seen(Vec3::new(-3.0, 0.2, 0.5)).is_none(), "on the geometric front, behind the normals");
    let back = seen(Vec3::new(5.0, 0.2, -0.2)).expect("on the geometric back, in front of the normals");
    let p = Vec3::new(5.0, 0.2, -0.2);
    let q = p + back.wi * back.distance;
    let at = shapes[0].surface_point(0, 0, p, back.wi, ShapeHit { t: back.distance, u: q.x, v: q.y });
    assert_eq!(all.emitted(&shapes, NO_TEXTURES, &at, -back.wi), Rgb::ONE);
    assert!((all.pdf_dir_surface(&shapes, p, &at) / back.pdf_dir - 1.0).abs() < 1e-5);
    assert_eq!(all.emitted(&shapes, NO_TEXTURES, &at, back.wi), Rgb::ZERO);
}

#[test]
fn many_bins_keep_their_probabilities_under_24_bit_numbers() {
    // 256 numbers of 24 bits per bin, of which one bin in two gives 5.12 to its own entry: without more bits it is 6.
    let weights: Vec<f64> = (0..65_536).map(|i| if i % 2 == 0 { 1.0 } else { 0.0101 }).collect();
    let table = AliasTable::new(&weights);
    let count = |refined: bool| {
        let n = 1u64 << 22;
        let hits = (0..n).filter(|&i| {
            let u_light = random(5, i, 0);
            let u = if refined { refine(u_light, random2(4, i)) } else { u_light as f64 };
            table.sample(u).unwrap() % 2 == 1
        });
        hits.count() as f64 / n as f64
    };
    let p = 0.0101 / 1.0101;
    assert!((count(true) / p - 1.0).abs() < 0.02, "{}", count(true) / p);
    assert!((count(false) / p - 1.0).abs() > 0.02, "{}: the plain number is biased", count(false) / p);
}

#[test]
fn textured_lamps_send_the_texture_at_the_sampled_point() {
    let corner = |r, g| Rgb::new(r, g, 0.0);
    let images = [Bitmap {
        width: 2,
        height: 2,
        pixels: vec![corner(1.0, 1.0), corner(3.0, 1.0), corner(1.0, 5.0), corner(3.0, 5.0)],
    }];
    let textures =
        [Texture::Bitmap { image: 0, filter: TexFilter::Nearest, wrap: Wrap::Clamp, to_uv: Default::default() }];
    let textures = Textures { textures: &textures, images: &images };
    let ball = GeometryDesc::Sphere { center: DVec3::ZERO, radius: 1.0 };
    for (geometry, p) in [
        (GeometryDesc::Rectangle, Vec3::new(0.3, 0.2, 0.7)),
        (GeometryDesc::Disk, Vec3::new(0.3, 0.2, 0.7)),
        (ball, Vec3::new(2.0, -1.0, 1.0)),
    ] {
        let shapes = [Shape { emission: Some(Color::Texture(0)), ..lamp(geometry, DMat4::IDENTITY, false, Rgb::ONE) }];
        let all = Lights::new(&shapes, &[], textures.textures, &images, (Vec3::ZERO, 10.0));
        assert_eq!(all.infos[0].power.y / all.infos[0].power.x, 1.5);
        let mut colours = std::collections::BTreeSet::new();
        for i in 0..500 {
            let s = all.sample(&shapes, textures, p, 0.5, random2(1, i)).expect("a bright lamp");
            let hit = ShapeHit { t: s.distance, u: 0.0, v: 0.0 };
            let at = shapes[0].surface_point(0, 0, p, s.wi, hit);
            assert_eq!(all.emitted(&shapes, textures, &at, -s.wi) / s.pdf_dir, s.weight);
            let radiance = s.weight * s.pdf_dir;
            colours.insert((radiance.x.round() as u32, radiance.y.round() as u32));
        }
        assert!(colours.len() >= 3, "several texels: {colours:?}");
        assert!(colours.iter().all(|c| [1, 3].contains(&c.0) && [1, 5].contains(&c.1)));
    }
}
