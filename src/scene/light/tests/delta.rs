//! Points, spots and parallel light against numbers of Mitsuba 3.9.1 and against integration.

use super::super::delta::DeltaLight;
use super::*;
use crate::math::warp::sample_sphere;
use crate::scene::texture::{TexFilter, Wrap};

fn spot(to_world: DMat4, cutoff: f64, beam: f64, texture: Option<u32>) -> LightDesc {
    LightDesc::Spot {
        to_world,
        intensity: Rgb::splat(5.0),
        cutoff_angle: cutoff.to_radians(),
        beam_width: beam.to_radians(),
        texture,
    }
}

#[test]
fn spot_ramp_as_mitsuba() {
    let light = DeltaLight::new(&spot(DMat4::IDENTITY, 40.0, 20.0, None)).unwrap();
    for (deg, value) in [(0.0f32, 1.25), (10.0, 1.25), (20.0, 1.25), (25.0, 0.9375), (30.0, 0.625), (39.0, 0.0625)] {
        let (s, c) = deg.to_radians().sin_cos();
        let a = light.arrival(NO_TEXTURES, 2.0 * Vec3::new(s, 0.0, c)).unwrap();
        assert!((a.value.x - value).abs() < 2e-6, "{deg}: {}", a.value.x);
        assert!((a.distance - 2.0).abs() < 1e-6 && (a.wi + Vec3::new(s, 0.0, c)).length() < 1e-6);
    }
    for deg in [40.1f32, 90.0, 180.0] {
        let (s, c) = deg.to_radians().sin_cos();
        assert!(light.arrival(NO_TEXTURES, 2.0 * Vec3::new(s, 0.0, c)).is_none());
    }
}

#[test]
fn spot_texture_as_mitsuba() {
    // 8 x 8 ramp: texel (x, y) holds (24 y + 3 x, + 1, + 2) / 192.
    let pixels = (0..64).map(|i| Rgb::new(0.0, 1.0, 2.0) / 192.0 + 3.0 * i as f32 / 192.0).collect();
    let images = [Bitmap { width: 8, height: 8, pixels }];
    let textures =
        [Texture::Bitmap { image: 0, filter: TexFilter::Bilinear, wrap: Wrap::Repeat, to_uv: Default::default() }];
    let textures = Textures { textures: &textures, images: &images };
    let light = DeltaLight::new(&spot(DMat4::IDENTITY, 40.0, 20.0, Some(0))).unwrap();
    for (x, y, texel) in
        [(0.0f32, 0.0f32, 94.5), (0.3, 0.0, 98.7903), (0.0, 0.3, 128.8225), (-0.3, 0.0, 90.2097), (-0.2, 0.1, 103.0806)]
    {
        let p = 2.0 * Vec3::new(x, y, 1.0);
        let a = light.arrival(textures, p).unwrap();
        let found = a.value * p.length_squared() / 5.0 * 192.0;
        assert!((found - Vec3::new(texel, texel + 1.0, texel + 2.0)).length() < 1e-3, "{x} {y}: {found}");
    }
    check_power(&light, textures);
}

/// `power` against integration over directions: the light's value on the unit sphere around it.
fn check_power(light: &DeltaLight, textures: Textures) {
    let n = 1 << 11;
    let mut sum = 0.0;
    for i in 0..n * n / 4 {
        let u = Vec2::new(((i % n) as f32 + 0.5) / n as f32, ((i / n) as f32 + 0.5) / (n / 4) as f32);
        // The spot sits at the origin.
        sum += light.arrival(textures, sample_sphere(u)).map_or(0.0, |a| a.value.x as f64);
    }
    let power = sum / (n * n / 4) as f64 * 4.0 * std::f64::consts::PI;
    let ours = light.power(textures, 1.0).x as f64;
    assert!((ours / power - 1.0).abs() < 2e-3, "{ours} {power}");
}

#[test]
fn spot_power_is_the_integral_of_its_ramp() {
    for (cutoff, beam) in [(40.0, 20.0), (60.0, 60.0), (100.0, 0.0), (20.0, 15.0)] {
        check_power(&DeltaLight::new(&spot(DMat4::IDENTITY, cutoff, beam, None)).unwrap(), NO_TEXTURES);
    }
}

#[test]
fn transforms_turn_and_move_a_spot() {
    let to_world =
        DMat4::from_translation(DVec3::new(1.0, 2.0, 3.0)) * DMat4::from_rotation_y(std::f64::consts::FRAC_PI_2);
    let light = DeltaLight::new(&spot(to_world, 40.0, 20.0, None)).unwrap();
    let a = light.arrival(NO_TEXTURES, Vec3::new(3.0, 2.0, 3.0)).expect("+z of the light is +x of the world");
    assert!((a.value.x - 1.25).abs() < 1e-5);
    assert!(light.arrival(NO_TEXTURES, Vec3::new(1.0, 2.0, 5.0)).is_none());
}

#[test]
fn point_and_parallel_light_weigh_as_they_should() {
    let others = [
        LightDesc::Point { position: DVec3::new(0.0, 0.0, 2.0), intensity: Rgb::new(1.0, 2.0, 3.0) },
        LightDesc::Directional { direction: DVec3::new(0.0, 0.0, -7.0), irradiance: Rgb::new(4.0, 5.0, 6.0) },
    ];
    for (k, light) in others.into_iter().enumerate() {
        let s = lights(&[], &[light]).sample(&[], NO_TEXTURES, Vec3::ZERO, 0.3, Vec2::splat(0.5)).unwrap();
        assert_eq!((s.wi, s.pdf_dir, s.light), (Vec3::Z, 0.0, 0));
        let expected = [(2.0, Rgb::new(0.25, 0.5, 0.75)), (f32::INFINITY, Rgb::new(4.0, 5.0, 6.0))][k];
        assert_eq!((s.distance, s.weight), expected);
    }
    let here = lights(&[], &[LightDesc::Point { position: DVec3::ZERO, intensity: Rgb::ONE }]);
    assert!(here.sample(&[], NO_TEXTURES, Vec3::ZERO, 0.3, Vec2::ZERO).is_none());
}
