//! Same seed, same bits: for any number of threads, with and without processor-specific instructions, cropped or whole.

mod common;

use common::*;
use dualux::accel::Simd;
use dualux::integrators::path::PathSettings;
use dualux::math::{DMat4, DVec3, Rgb};
use dualux::render::Progress;
use dualux::scene::description::*;
use dualux::scene::{Color, Material};

/// A room with every kind of shape in it.
fn room() -> Description {
    let mut scene = empty_scene(DVec3::new(0.0, 1.0, -3.5), DVec3::new(0.0, 0.8, 0.0), 37, 29);
    let grey = diffuse(&mut scene, 0.7);
    let white = Color::Constant(Rgb::ONE);
    let glass = material(
        &mut scene,
        Material::Dielectric { eta: 1.5, specular_reflectance: white.clone(), specular_transmittance: white },
    );
    let walls = DMat4::from_translation(DVec3::new(0.0, 1.0, 0.0)) * DMat4::from_scale(DVec3::new(2.0, 1.2, -4.0));
    shape(&mut scene, GeometryDesc::Cube, walls, grey, None);
    shape(
        &mut scene,
        GeometryDesc::Sphere { center: DVec3::new(0.6, 0.3, 0.2), radius: 0.5 },
        DMat4::IDENTITY,
        glass,
        None,
    );
    shape(
        &mut scene,
        GeometryDesc::Cylinder { p0: DVec3::new(-0.9, -0.2, 0.5), p1: DVec3::new(-0.7, 0.9, 0.3), radius: 0.25 },
        DMat4::IDENTITY,
        grey,
        None,
    );
    let down = DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let lamp = DMat4::from_translation(DVec3::new(0.3, 2.1, 0.0)) * DMat4::from_scale(DVec3::splat(0.3)) * down;
    shape(&mut scene, GeometryDesc::Disk, lamp, grey, Some(9.0));
    scene
}

fn bits(done: &Progress) -> Vec<[u32; 3]> {
    done.film.picture(1).iter().map(|c| c.to_array().map(f32::to_bits)).collect()
}

fn with_threads(n: usize, work: impl FnOnce() -> Progress + Send) -> Vec<[u32; 3]> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("thread pool");
    bits(&pool.install(work))
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let one = with_threads(1, || render_path(room(), PathSettings::default(), 3, 5));
    for n in [2, 7] {
        assert!(one == with_threads(n, || render_path(room(), PathSettings::default(), 3, 5)), "{n} threads");
    }
    assert!(one != with_threads(1, || render_path(room(), PathSettings::default(), 3, 6)), "another seed");
}

#[test]
fn the_portable_traversal_gives_the_same_bits() {
    let with = |simd| bits(&render_path_with(room(), PathSettings::default(), 3, 5, simd));
    assert!(with(Simd::Avx2) == with(Simd::Portable));
}

#[test]
fn a_crop_window_shows_the_same_pixels() {
    let whole = render_path(room(), PathSettings::default(), 2, 5);
    let mut scene = room();
    scene.film.crop = [9, 4, 20, 18];
    let part = render_path(scene, PathSettings::default(), 2, 5);
    let (whole, part) = (bits(&whole), bits(&part));
    for y in 0..18 {
        assert!(part[y * 20..(y + 1) * 20] == whole[(y + 4) * 37 + 9..(y + 4) * 37 + 29], "row {y}");
    }
}
