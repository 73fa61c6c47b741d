//! Many lights: one mean for all ways to choose a light, determinism of culling.

mod common;

use common::*;
use dualux::accel::Simd;
use dualux::integrators::path::PathSettings;
use dualux::math::sampler::{hash, unit_f32};
use dualux::math::{DMat4, DVec3, Rgb};
use dualux::scene::description::*;
use dualux::scene::material::{Distribution, Roughness};
use dualux::scene::{Color, Description, Material, Scalar};
use dualux::transport::light_cull::{CullingSettings, Reservoir};
use dualux::transport::light_selection::{LightStrategy, SelectionSettings};

/// A box with a glossy and a diffuse ball, 60 lamps of three kinds, and light from infinity through its open side.
fn lamps() -> Description {
    let mut scene = empty_scene(DVec3::new(0.0, 0.0, -2.6), DVec3::ZERO, 12, 12);
    let white = diffuse(&mut scene, 0.6);
    let side = material(&mut scene, Material::TwoSided { front: white, back: white });
    for (axis, at) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0), (2, 1.0)] {
        let turn = match axis {
            0 => DMat4::from_rotation_y(std::f64::consts::FRAC_PI_2),
            1 => DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2),
            _ => DMat4::IDENTITY,
        };
        let offset = DVec3::from_array(std::array::from_fn(|k| if k == axis { at } else { 0.0 }));
        shape(&mut scene, GeometryDesc::Rectangle, DMat4::from_translation(offset) * turn, side, None);
    }
    let metal = material(
        &mut scene,
        Material::RoughConductor {
            eta: Color::Constant(Rgb::splat(1.5)),
            k: Color::Constant(Rgb::splat(4.0)),
            specular_reflectance: Color::Constant(Rgb::ONE),
            roughness: Roughness {
                distribution: Distribution::Ggx,
                alpha_u: Scalar::Constant(0.3),
                alpha_v: Scalar::Constant(0.3),
            },
        },
    );
    let ball = |x| GeometryDesc::Sphere { center: DVec3::new(x, -0.6, 0.1), radius: 0.35 };
    shape(&mut scene, ball(-0.45), DMat4::IDENTITY, metal, None);
    shape(&mut scene, ball(0.45), DMat4::IDENTITY, white, None);
    for i in 0..60 {
        let r = |k| f64::from(unit_f32(hash(i, k)));
        let center = DVec3::new(1.8 * r(1) - 0.9, 1.2 * r(2) - 0.3, 1.4 * r(3) - 0.7);
        let radiance = 0.5 + 8.0 * (r(4) * r(4)) as f32;
        let place = DMat4::from_translation(center)
            * DMat4::from_rotation_x(1.2 + r(5))
            * DMat4::from_scale(DVec3::splat(0.02 + 0.03 * r(6)));
        match i % 3 {
            0 => {
                shape(&mut scene, GeometryDesc::Sphere { center, radius: 0.03 }, DMat4::IDENTITY, white, Some(radiance))
            }
            1 => shape(&mut scene, GeometryDesc::Disk, place, white, Some(radiance)),
            _ => scene.lights.push(LightDesc::Point { position: center, intensity: Rgb::splat(0.02 * radiance) }),
        }
    }
    scene.lights.push(LightDesc::Constant { radiance: Rgb::splat(0.1) });
    scene
}

fn settings(strategy: LightStrategy, culling: CullingSettings, seed: u64) -> PathSettings {
    PathSettings {
        max_depth: Some(4),
        lights: SelectionSettings { strategy, culling, seed },
        ..PathSettings::default()
    }
}

#[test]
fn all_ways_to_choose_a_light_make_one_picture() {
    let mean = |strategy, culling, scale: f32| {
        mean_over_runs(24, |seed| {
            let mut scene = lamps();
            for light in &mut scene.lights {
                if let LightDesc::Point { intensity, .. } = light {
                    *intensity *= scale;
                }
            }
            render_path(scene, settings(strategy, culling, seed), 32, 50 + seed)
        })
    };
    let culled = |reservoir, kept, lights| CullingSettings { lights, kept, reservoir, error: None };
    let default = CullingSettings::default();
    let (truth, error) = mean(LightStrategy::Tree, default, 1.0);
    let others = [
        ("power", LightStrategy::Power, default),
        ("uniform", LightStrategy::Uniform, default),
        ("weighted", LightStrategy::Culling, culled(Reservoir::Weighted, 1, 6.0)),
        ("weighted, 3", LightStrategy::Culling, culled(Reservoir::Weighted, 3, 12.0)),
        ("alike", LightStrategy::Culling, culled(Reservoir::Uniform, 2, 6.0)),
    ];
    for (name, strategy, culling) in others {
        let (m, e) = mean(strategy, culling, 1.0);
        let z = (m - truth) / e.hypot(error);
        // Quantile at 0.01 / 5 for Student's t with some 40 degrees of freedom.
        assert!(z.abs() < 3.5, "{name}: {m} +- {e}, tree {truth} +- {error}: z = {z}");
    }
    // Companion: a sixth of the light off by 15 % is seen.
    let (m, e) = mean(LightStrategy::Culling, default, 1.15);
    let z = (m - truth) / e.hypot(error);
    assert!(z > 3.5, "{m} +- {e}, {truth} +- {error}: z = {z}");
}

#[test]
fn culling_is_the_same_with_any_instructions_and_differs_from_pass_to_pass() {
    let of = |simd, passes| {
        let s = settings(LightStrategy::Culling, CullingSettings::default(), 3);
        render_path_with(lamps(), s, passes, 3, simd).film.pixels().iter().map(|p| p.mean()).collect::<Vec<_>>()
    };
    assert_eq!(of(Simd::Avx2, 3), of(Simd::Portable, 3));
    assert_ne!(of(Simd::Avx2, 1), of(Simd::Avx2, 2));
}
