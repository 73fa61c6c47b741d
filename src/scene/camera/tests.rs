//! Rays against numbers printed by Mitsuba 3.9.1 (`sensor.sample_ray`, 6 x 4 pixels), and `project` against `ray`.

use super::*;
use crate::math::filter::PixelFilter;

const FILM: FilmDesc = FilmDesc { width: 6, height: 4, crop: [0, 0, 6, 4], filter: PixelFilter::Box { radius: 0.5 } };

/// look_at(origin (1,2,3), target (2,1.5,-1), up y) times a scale of the columns.
fn to_world(scale: [f64; 3]) -> DMat4 {
    let z = DVec3::new(1.0, -0.5, -4.0).normalize();
    let x = DVec3::Y.cross(z).normalize();
    let y = z.cross(x);
    let col = |v: DVec3, s: f64| (v * s).extend(0.0);
    let origin = DVec3::new(1.0, 2.0, 3.0).extend(1.0);
    DMat4::from_cols(col(x, scale[0]), col(y, scale[1]), col(z, scale[2]), origin)
}

fn perspective(scale: [f64; 3], offset: [f64; 2], lens: (f64, f64)) -> CameraDesc {
    CameraDesc {
        to_world: to_world(scale),
        projection: Projection::Perspective {
            x_fov: 50f64.to_radians(),
            principal_point_offset: offset,
            aperture_radius: lens.0,
            focus_distance: lens.1,
        },
        near_clip: 0.5,
        far_clip: 20.0,
    }
}

fn orthographic(scale: [f64; 3]) -> CameraDesc {
    CameraDesc { projection: Projection::Orthographic, ..perspective(scale, [0.0; 2], (0.0, 1.0)) }
}

/// Compares a ray with Mitsuba's: its origin is ours moved to the near plane, its end is far - near.
fn check(ray: CameraRay, o: [f32; 3], d: [f32; 3], length: f32) {
    let at_near = ray.o + ray.d * ray.tmin;
    assert!((at_near - Vec3::from(o)).length() < 4e-6, "{at_near} {o:?}");
    assert!((ray.d - Vec3::from(d)).length() < 1e-6, "{} {d:?}", ray.d);
    assert!((ray.d.length() - 1.0).abs() < 1e-6);
    assert!(((ray.tmax - ray.tmin) / length - 1.0).abs() < 1e-5, "{} {length}", ray.tmax - ray.tmin);
}

fn at(x: f32, y: f32) -> Vec2 {
    Vec2::new(x * 6.0, y * 4.0)
}

#[test]
fn pinhole_as_mitsuba() {
    let c = Camera::new(&perspective([1.0; 3], [0.0; 2], (0.0, 1.0)), &FILM).unwrap();
    let r = |x, y| c.ray(at(x, y), Vec2::ZERO);
    check(r(0.0, 0.0), [0.898732, 2.094112, 2.443755], [-0.1766817, 0.1641972, -0.9704757], 22.353533);
    check(r(0.25, 0.75), [1.00502, 1.862654, 2.499259], [0.0096684, -0.264503, -0.9643365], 20.251114);
    check(r(1.0, 1.0), [1.34204, 1.785502, 2.593158], [0.5967537, -0.3742332, -0.709813], 22.353533);
    assert_eq!(r(0.3, 0.7).o, Vec3::new(1.0, 2.0, 3.0));
}

#[test]
fn principal_point_as_mitsuba() {
    // Mitsuba starts its rays at depth near / cos of the *unshifted* frustum; direction is what counts here.
    let c = Camera::new(&perspective([1.0; 3], [0.2, -0.1], (0.0, 1.0)), &FILM).unwrap();
    for (x, y, d) in [
        (0.0, 0.0, [-0.0179151, 0.2265291, -0.9738396]),
        (0.25, 0.75, [0.1917704, -0.2118207, -0.9583089]),
        (1.0, 1.0, [0.7106184, -0.3010812, -0.6359022]),
        (0.5, 0.5, [0.4155846, -0.0575616, -0.9077314]),
    ] {
        let ray = c.ray(at(x, y), Vec2::ZERO);
        assert!((ray.d - Vec3::from(d)).length() < 1e-6, "{} {d:?}", ray.d);
    }
}

#[test]
fn mirrored_matrix_as_mitsuba() {
    let mut desc = perspective([-1.0, 1.0, 1.0], [0.0; 2], (0.0, 1.0));
    (desc.near_clip, desc.far_clip) = (0.01, 10000.0);
    let c = Camera::new(&desc, &FILM).unwrap();
    let r = |x, y| c.ray(at(x, y), Vec2::ZERO);
    check(r(0.0, 0.0), [1.007022, 2.001882, 2.991137], [0.61259, 0.1641972, -0.7731577], 11463.340);
    check(r(1.0, 1.0), [0.997793, 1.99571, 2.989601], [-0.1925177, -0.3742332, -0.9071308], 11463.339);
}

#[test]
fn thin_lens_as_mitsuba() {
    let c = Camera::new(&perspective([1.0; 3], [0.0; 2], (0.3, 4.0)), &FILM).unwrap();
    // Mitsuba's lens sample (0.9, 0.3), by its concentric map: radius 0.8 at the angle -pi/8.
    let (s, co) = (-std::f32::consts::PI / 8.0).sin_cos();
    let r = |x, y| c.ray_from_lens(at(x, y), Vec2::new(0.8 * co, 0.8 * s));
    check(r(0.0, 0.0), [0.708163, 2.014333, 2.406085], [-0.1308794, 0.1864971, -0.9736988], 22.063995);
    check(r(0.25, 0.75), [0.814452, 1.782875, 2.46159], [0.0629607, -0.2459279, -0.9672412], 19.973314);
    // Whatever the map: all rays of one film position meet in the plane in focus, and the lens is filled.
    let centre = c.ray_from_lens(at(0.2, 0.9), Vec2::ZERO);
    let forward = DVec3::new(1.0, -0.5, -4.0).normalize().as_vec3();
    let meet = centre.o + centre.d * (4.0 / centre.d.dot(forward));
    let mut far_out = 0f32;
    for i in 0..64 {
        let ray = c.ray(at(0.2, 0.9), Vec2::new(i as f32 % 8.0, (i / 8) as f32) / 8.0);
        let t = 4.0 / ray.d.dot(forward);
        assert!((ray.o + ray.d * t - meet).length() < 1e-5);
        far_out = far_out.max((ray.o - centre.o).length());
    }
    assert!(far_out > 0.25 && far_out <= 0.3001, "{far_out}");
}

#[test]
fn orthographic_as_mitsuba() {
    let c = Camera::new(&orthographic([3.0, 3.0, 1.0]), &FILM).unwrap();
    let r = |x, y| c.ray(at(x, y), Vec2::ZERO);
    let d = [0.2407717, -0.1203859, -0.9630868];
    check(r(0.0, 0.0), [-1.731646, 3.925261, 1.557267], d, 19.5);
    check(r(0.25, 0.75), [-0.364026, 0.94708, 2.271445], d, 19.5);
    check(r(1.0, 1.0), [3.972417, -0.045647, 3.479646], d, 19.5);
}

#[test]
fn project_undoes_ray() {
    for desc in [
        perspective([1.0; 3], [0.2, -0.1], (0.0, 1.0)),
        perspective([-1.0, 1.0, 1.0], [0.0; 2], (0.0, 1.0)),
        orthographic([3.0, 2.0, 2.0]),
    ] {
        let c = Camera::new(&desc, &FILM).unwrap();
        for (x, y) in [(0.1, 0.2), (0.0, 1.0), (0.7, 0.5), (1.3, -0.2)] {
            let ray = c.ray(at(x, y), Vec2::ZERO);
            let p = |t: f32| ray.o + ray.d * t;
            let mid = 0.5 * (ray.tmin + ray.tmax);
            let film = c.project(p(mid)).unwrap();
            assert!((film - at(x, y)).length() < 1e-4, "{film} {x} {y}");
            assert!(c.project(p(ray.tmin * 0.99)).is_none() && c.project(p(ray.tmax * 1.01)).is_none());
            assert!(c.project(p(ray.tmin * 1.01)).is_some() && c.project(p(ray.tmax * 0.99)).is_some());
            assert!(c.project(p(-mid)).is_none(), "behind the camera");
        }
    }
}

#[test]
fn unusable_cameras_are_refused() {
    let error = |desc: CameraDesc| Camera::new(&desc, &FILM).unwrap_err();
    let fov = |x_fov| {
        let mut desc = perspective([1.0; 3], [0.0; 2], (0.0, 1.0));
        if let Projection::Perspective { x_fov: f, .. } = &mut desc.projection {
            *f = x_fov;
        }
        desc
    };
    for bad in [0.0, PI, -1.0, f64::NAN] {
        assert!(error(fov(bad)).contains("field of view"));
    }
    assert!(error(perspective([1.0, 1.0, 0.0], [0.0; 2], (0.0, 1.0))).contains("singular"));
    assert!(error(perspective([1.0, f64::NAN, 1.0], [0.0; 2], (0.0, 1.0))).contains("finite"));
    assert!(error(perspective([1.0; 3], [f64::INFINITY, 0.0], (0.0, 1.0))).contains("principal"));
    assert!(error(perspective([1.0; 3], [0.0; 2], (0.1, 0.0))).contains("focus"));
    assert!(error(perspective([1.0; 3], [0.0; 2], (-0.1, 1.0))).contains("radius"));
    let mut clip = perspective([1.0; 3], [0.0; 2], (0.0, 1.0));
    clip.far_clip = 0.1;
    assert!(error(clip).contains("clip"));
    let none = FilmDesc { width: 0, ..FILM };
    assert!(Camera::new(&perspective([1.0; 3], [0.0; 2], (0.0, 1.0)), &none).is_err());
}
