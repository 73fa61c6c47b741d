//! The kernel: integral over planes, clamps, boxes.

use super::*;
use crate::transport::footprint_kernel::{Ellipsoid, Smallest, Widths};
use crate::transport::photon::{Photon, PhotonClass};

pub fn photon(p: Vec3, n: Vec3, sigma: [Vec3; 2]) -> Photon {
    let flux = Rgb::ONE;
    let class = PhotonClass::Caustic;
    Photon {
        p,
        wi: n,
        n,
        flux,
        shading: 1.0,
        sigma,
        parameters: 2,
        shape: 0,
        prim: 0,
        light: 0,
        stratum: 0,
        segments: 1,
        class,
    }
}

const WIDE: Widths = Widths { scale: [2.0, 1.0], min: Smallest::Fixed(1e-3), max: 10.0 };

/// Integral of the kernel over the plane through its centre with unit tangents `s`, `t`, in steps of `h`.
fn integral(e: &Ellipsoid, s: Vec3, t: Vec3, reach: f32) -> f64 {
    let n = 600;
    let h = 2.0 * reach / n as f32;
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let (a, b) = ((i as f32 + 0.5) * h - reach, (j as f32 + 0.5) * h - reach);
            sum += f64::from((1.0 - e.q(e.p + s * a + t * b)).max(0.0));
        }
    }
    sum * f64::from(e.peak() * h * h)
}

#[test]
fn kernels_integrate_to_one_on_any_plane_and_have_the_covariance_asked_for() {
    for seed in 0..20 {
        let mut rng = Sampler::new(seed, 0, 0);
        let [a, b, c, d] = rng.next_4d();
        let n = if seed == 0 { Vec3::Y } else { warp::sample_sphere([a, b].into()) };
        let frame = crate::math::Frame::from_normal(n);
        let (long, short) = ((frame.s * (6.0 * d).cos() + frame.t * (6.0 * d).sin()) * 0.3, 0.02 + 0.28 * c);
        let p = photon(Vec3::new(3.0, -1.0, 2.0) * a, n, [long, n.cross(long).normalize() * short]);
        let e = WIDE.ellipsoid(&p);
        let got = integral(&e, frame.s, frame.t, e.radii[0] * 1.01);
        assert!((got - 1.0).abs() < 1e-3, "{got}");
        // r = sqrt 6 standard deviations, scaled.
        assert!((e.radii[0] - 2.0 * 6f32.sqrt() * 0.3).abs() < 1e-5);
        assert!((e.radii[1] - 2.0 * 6f32.sqrt() * short).abs() < 1e-5);
        // A peak that forgets the shorter axis would be seen.
        let wrong = 2.0 / (PI * e.radii[0] * e.radii[0]);
        assert!(e.radii[1] > 0.99 * e.radii[0] || (got * f64::from(wrong / e.peak()) - 1.0).abs() > 5e-3);
    }
}

#[test]
fn widths_are_clamped_and_unknown_neighbourhoods_get_the_greatest() {
    let w = Widths { scale: [1.0; 2], min: Smallest::Fixed(0.1), max: 0.5 };
    let radii = |long: Vec3, short: Vec3| w.ellipsoid(&photon(Vec3::ZERO, Vec3::Z, [long, short])).radii;
    assert_eq!(radii(Vec3::X * 9.0, Vec3::Y * 1e-9), [0.5, 0.1]);
    assert_eq!(radii(Vec3::ZERO, Vec3::ZERO), [0.1, 0.1]);
    assert_eq!(radii(Vec3::INFINITY, Vec3::INFINITY), [0.5, 0.5]);
    assert_eq!(radii(Vec3::NAN, Vec3::NAN), [0.5, 0.5]);
    let e = Widths::fixed(0.25).ellipsoid(&photon(Vec3::ONE, Vec3::X, [Vec3::Y * 3.0, Vec3::Z]));
    // A ball of one radius in every direction.
    for d in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE.normalize()] {
        assert!((e.q(Vec3::ONE + d * 0.25) - 1.0).abs() < 1e-5);
    }
}

#[test]
fn boxes_hold_their_ellipsoids_tightly() {
    for seed in 0..50 {
        let mut rng = Sampler::new(seed, 0, 0);
        let [a, b, c, d] = rng.next_4d();
        let n = warp::sample_sphere([a, b].into());
        let long = crate::math::Frame::from_normal(n).s * (0.1 + c);
        let e = WIDE.ellipsoid(&photon(Vec3::ZERO, n, [long, n.cross(long) * (0.05 + 0.9 * d)]));
        let half = e.half_box();
        let mut reach = Vec3::ZERO;
        for i in 0..20_000 {
            let u = Sampler::new(seed, 1, i).next_2d();
            let d = warp::sample_sphere(u);
            reach = reach.max((d / e.q(d).sqrt()).abs());
        }
        assert!((half - reach).min_element() >= -1e-4 * half.max_element(), "{half} {reach}");
        assert!((half - reach).max_element() <= 0.02 * half.max_element(), "{half} {reach}");
    }
}

#[test]
fn pixels_set_the_smallest_width() {
    let room = Room::new(empty());
    let Smallest::Pixels { eye, per_distance } = Smallest::pixels(&room.scene.camera, [64, 64], 2.0) else {
        panic!("a perspective camera")
    };
    assert_eq!(eye, Vec3::new(0.0, 10.0, 0.0));
    assert!((per_distance - 2.0 * 2.0 * 0.5f32.tan() / 64.0).abs() < 1e-6);
}
