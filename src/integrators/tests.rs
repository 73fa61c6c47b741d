//! What samples of every integrator say of what they see: depth and guides.

use super::Integrator;
use super::many_light::{ManyLight, ManyLightSettings};
use super::path::{Path, PathSettings};
use super::photon::{Photon, PhotonSettings};
use crate::image::film::Features;
use crate::integrators::Counts;
use crate::math::{DVec3, Rgb, Sampler, Vec2, Vec3};
use crate::scene::Color;
use crate::scene::description::{Description, GeometryDesc};
use crate::transport::tests::{Room, add, add_material, diffuse, empty, mirror, square};

/// Features of a sample in the middle of the picture, whose camera is ten units above the origin and looks down, by each integrator.
fn seen(scene: Description, hide_emitters: bool) -> Vec<(&'static str, Features)> {
    let room = Room::new(scene);
    let (world, window) = (room.world(), [0, 0, 64, 64]);
    let path = PathSettings { hide_emitters, ..PathSettings::default() };
    let photon = PhotonSettings { path, ..PhotonSettings::default() };
    let many = ManyLightSettings { path, ..ManyLightSettings::default() };
    let all: [Box<dyn Integrator>; 3] = [
        Box::new(Path::new(world, path)),
        Box::new(Photon::new(world, photon, window)),
        Box::new(ManyLight::new(world, many, window)),
    ];
    let ray = world.scene.camera.ray(Vec2::splat(32.0), Vec2::splat(0.5));
    let one = |mut integrator: Box<dyn Integrator>| {
        integrator.prepare(0, &|| false);
        let mut counts = Counts::default();
        (integrator.name(), integrator.sample(&ray, 0, &mut Sampler::new(1, 2, 3), &mut counts).1)
    };
    all.into_iter().map(one).collect()
}

fn floor() -> Description {
    let mut scene = empty();
    let grey = diffuse(&mut scene, 0.5);
    add(&mut scene, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::Y, 4.0), grey);
    scene
}

#[test]
fn hidden_lamps_do_not_shorten_the_way() {
    let mut scene = floor();
    add(&mut scene, GeometryDesc::Rectangle, square(DVec3::Y * 5.0, DVec3::Y, 1.0), 0);
    scene.shapes[1].emission = Some(Color::Constant(Rgb::ONE));
    for (name, features) in seen(scene.clone(), true) {
        assert!((features.depth - 10.0).abs() < 1e-3, "{name}: {}", features.depth);
        assert!((features.guide.distance - 10.0).abs() < 1e-3 && features.guide.emitted == 0.0, "{name}");
    }
    for (name, features) in seen(scene, false) {
        assert!((features.depth - 5.0).abs() < 1e-3 && features.guide.emitted == 1.0, "{name}: {features:?}");
    }
}

#[test]
fn guides_are_those_of_what_a_mirror_shows() {
    // A mirror turned by 45 degrees on the floor, and a wall three units beside it.
    let mut scene = empty();
    let (grey, mirror) = (diffuse(&mut scene, 0.5), mirror());
    let mirror = add_material(&mut scene, mirror);
    add(&mut scene, GeometryDesc::Rectangle, square(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), 1.0), mirror);
    add(&mut scene, GeometryDesc::Rectangle, square(DVec3::X * 3.0, -DVec3::X, 2.0), grey);
    for (name, Features { depth, normal, guide, .. }) in seen(scene, false) {
        // The first surface is the mirror, whatever it shows.
        assert!((depth - 10.0).abs() < 1e-3 && normal.y > 0.5, "{name}: {depth} {normal}");
        let share = guide.normal.length();
        assert!(share > 0.1 && (guide.normal / share - Vec3::NEG_X).length() < 1e-3, "{name}: {guide:?}");
        assert!((guide.albedo / share - Rgb::splat(0.5)).abs().max_element() < 1e-3, "{name}: {guide:?}");
        // By many lights the way since the mirror.
        let way = guide.distance / share;
        assert!((way - 13.0).abs() < 1e-2 || (name == "many-light" && (way - 3.0).abs() < 1e-2), "{name}: {way}");
    }
}
