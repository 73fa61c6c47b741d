//! Cells that are left out hold no ray that meets a wanted shape first.

use super::adaptive::first_hit;
use super::*;
use crate::accel::Accel;

/// Mirrors and glass in a room of sorts: a sphere, a mesh, a rectangle behind a screen; material 3 (null) hides nothing.
pub(super) fn surroundings(moved: f64) -> Vec<ShapeDesc> {
    let v = DVec3::new;
    let quad = |c, x, y, m| shape(GeometryDesc::Rectangle, placed(c, x, y), m, None);
    let ball = GeometryDesc::Sphere { center: v(-0.9 + moved, 0.4, 0.3), radius: 0.35 };
    let up = DMat4::from_translation(v(1.2, 0.2, -0.5)) * DMat4::from_scale(DVec3::splat(0.25));
    vec![
        quad(DVec3::ZERO, v(3.0, 0.0, 0.0), v(0.0, 0.0, -2.0), 0),
        shape(ball, DMat4::IDENTITY, 2, None),
        shape(roof(false), up, 1, None),
        // A mirror on the wall, and a screen before half of it; a sheet of nothing before the rest.
        quad(v(2.9, 1.0, 0.0), v(0.0, 0.6, 0.0), v(0.0, 0.0, 0.8), 1),
        quad(v(2.2, 1.0, 0.5), v(0.0, 1.2, 0.0), v(0.0, 0.0, 0.6), 0),
        quad(v(2.3, 1.0, -0.5), v(0.0, 1.2, 0.0), v(0.0, 0.0, 0.3), 3),
    ]
}

pub(super) fn wanted(scene: &Scene) -> impl Fn(u32) -> bool {
    let materials: Vec<u32> = scene.shapes.iter().map(|s| s.material).collect();
    move |s| [1, 2].contains(&materials[s as usize])
}

/// The lights of [`every_light`] in these surroundings.
fn scenes(moved: f64) -> Vec<(&'static str, Scene)> {
    let v = DVec3::new;
    let down = placed(v(-0.2, 2.4, 0.1), v(0.3, 0.05, 0.0), v(0.0, 0.02, 0.25));
    let lamp = |g: GeometryDesc| [surroundings(moved), vec![lit(g, down)]].concat();
    let ball = GeometryDesc::Sphere { center: v(0.3, 1.9, 0.2), radius: 0.2 };
    let tube = GeometryDesc::Cylinder { p0: v(0.0, 2.0, 0.0), p1: v(0.6, 2.3, 0.1), radius: 0.1 };
    let one = DMat4::IDENTITY;
    let small = down * DMat4::from_scale(DVec3::splat(0.4));
    let upright = [surroundings(moved), vec![lit(roof(true), small)]].concat();
    let light = |l: LightDesc| scene(surroundings(moved), vec![l]);
    let spot = LightDesc::Spot {
        to_world: placed(v(0.0, 2.0, 0.0), v(1.0, 0.0, 0.0), v(0.0, 0.2, 1.0)),
        intensity: Vec3::ONE,
        cutoff_angle: 0.9,
        beam_width: 0.5,
        texture: None,
    };
    vec![
        ("rectangle", scene(lamp(GeometryDesc::Rectangle), vec![])),
        ("disk", scene(lamp(GeometryDesc::Disk), vec![])),
        ("smooth mesh", scene(upright, vec![])),
        ("sphere", scene([surroundings(moved), vec![lit(ball, one)]].concat(), vec![])),
        ("cylinder", scene([surroundings(moved), vec![lit(tube, one)]].concat(), vec![])),
        ("point", light(LightDesc::Point { position: v(0.1, 2.2, 0.3), intensity: Vec3::ONE })),
        ("spot", light(spot)),
        ("directional", light(LightDesc::Directional { direction: v(0.3, -2.0, 0.4), irradiance: Vec3::ONE })),
        ("constant", light(LightDesc::Constant { radiance: Vec3::ONE })),
        ("envmap", light(LightDesc::EnvMap { image: 0, scale: Vec3::ONE, to_world: one })),
    ]
}

/// Rays of the natural density that meet a wanted shape first, and how many of them the density leaves out.
fn left_out(scene: &Scene, density: &EdgeAdaptive, rays: u64) -> (usize, usize) {
    let accel = Accel::new(&scene.shapes);
    let wanted = wanted(scene);
    let source = Source::new(scene, 0);
    let (mut found, mut missing) = (0, 0);
    for i in 0..rays {
        let Some((start, flux)) = source.emit(random(31, i)) else { continue };
        let (d, spread) = (start.d.as_vec3(), Spread::default());
        let mut ray = EmittedRay { o: start.o, d, flux, light: 0, stratum: 0, spread };
        // Null surfaces let pass.
        let mut hit = first_hit(&accel, &ray);
        while let Some((s, p)) = hit {
            if scene.shapes[s as usize].material != 3 {
                break;
            }
            ray.o = p + ray.d * 1e-4;
            hit = first_hit(&accel, &ray);
        }
        if hit.is_some_and(|(s, _)| wanted(s)) {
            found += 1;
            missing += usize::from(!density.holds(0, start.o.as_dvec3(), start.d));
        }
    }
    (found, missing)
}

#[test]
fn no_ray_that_is_left_out_meets_a_wanted_shape_first() {
    for ((name, scene), (_, other)) in scenes(0.0).into_iter().zip(scenes(0.5)) {
        let accel = Accel::new(&scene.shapes);
        let wants = wanted(&scene);
        let settings = Settings { interest: Some(&wants), ..Settings::default() };
        let density = EdgeAdaptive::new(&scene, &accel, 4000, &settings, 1);
        let (found, missing) = left_out(&scene, &density, 100_000);
        assert!(found > 100, "{name}: {found}");
        assert_eq!(missing, 0, "{name}: of {found}");
        let share = density.summary().kept / density.summary().power;
        println!("{name}: {} cells, share kept {share:.3}, of rays {:.3}", density.summary().cells, found as f64 / 1e5);
        if name != "cylinder" {
            assert!(share < 0.75, "{name}: {share}");
        }
        // Flux on wanted shapes is the same as that of uniform emission.
        let flux = |d: &dyn EmissionDensity, passes: u64| {
            let one = |i, p| d.emit(i, p).filter(|r| first_hit(&accel, r).is_some_and(|(s, _)| wants(s)));
            let all = (0..passes).flat_map(|p| (0..d.count()).filter_map(move |i| one(i, p)));
            all.map(|r| f64::from(r.flux.y)).sum::<f64>() / passes as f64
        };
        let (a, b) = (flux(&density, 10), flux(&Uniform::new(&scene, 10_000, Sequence::OwenSobol, 2), 20));
        // Two to three standard errors of some ten thousand hits of uniform emission.
        assert!((a / b - 1.0).abs() < 0.03, "{name}: {a} {b}");
        // Companion: the ball has moved, and cells chosen for its old place miss it.
        if !["cylinder", "constant", "envmap"].contains(&name) {
            let (_, missing) = left_out(&other, &density, 20_000);
            assert!(missing > 20, "{name}: {missing}");
        }
    }
}

#[test]
fn nothing_of_interest_means_no_photons() {
    for (name, scene) in scenes(0.0).into_iter().filter(|(n, _)| *n != "cylinder") {
        let accel = Accel::new(&scene.shapes);
        let settings = Settings { interest: Some(&|_| false), ..Settings::default() };
        let density = EdgeAdaptive::new(&scene, &accel, 1000, &settings, 1);
        assert_eq!((density.count(), density.emit(0, 0)), (0, None), "{name}");
    }
}

/// A lamp in a box with a lid that covers it all: glass outside of the box is not seen.
#[test]
fn what_a_screen_hides_is_left_out() {
    let v = DVec3::new;
    let quad = |c, x, y, m, e| shape(GeometryDesc::Rectangle, placed(c, x, y), m, e);
    let lamp = quad(v(0.0, 3.0, 0.0), v(0.2, 0.0, 0.0), v(0.0, 0.0, 0.2), 0, Some(Color::Constant(Vec3::ONE)));
    let glass = shape(GeometryDesc::Sphere { center: v(0.0, 1.0, 0.0), radius: 0.3 }, DMat4::IDENTITY, 2, None);
    let screen = |m| quad(v(0.0, 2.0, 0.0), v(8.0, 0.0, 0.0), v(0.0, 0.0, 8.0), m, None);
    let kept = |m: u32| {
        let scene = scene(vec![lamp.clone(), glass.clone(), screen(m)], vec![]);
        let accel = Accel::new(&scene.shapes);
        let settings = Settings { interest: Some(&|s| s == 1), ..Settings::default() };
        EdgeAdaptive::new(&scene, &accel, 2000, &settings, 1).summary().kept
    };
    assert_eq!(kept(0), 0.0, "a wall hides it");
    assert!(kept(3) > 0.0, "a null surface does not");
}
