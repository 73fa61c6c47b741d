//! Structures against brute force: random, duplicate, coplanar and mixed photons.

use super::kernel::photon;
use super::*;
use crate::transport::footprint_kernel::{Ellipsoid, Smallest, Widths};
use crate::transport::nearest::NearestPhotons;
use crate::transport::photon::Photon;
use crate::transport::photon_tree::PhotonTree;

fn number(i: u64, k: u64) -> f32 {
    crate::math::sampler::unit_f32(crate::math::sampler::hash(i, k))
}

/// Photons: anywhere, on walls that are parallel to axes, on one point, on a line; reaches over four decades.
fn arrangements() -> Vec<(&'static str, Vec<Photon>)> {
    let axis = [Vec3::X, Vec3::Y, Vec3::Z];
    let make = |f: &dyn Fn(u64) -> (Vec3, Vec3), n: u64| -> Vec<Photon> {
        let one = |i| {
            let (p, normal) = f(i);
            let t = normal.any_orthonormal_vector();
            let size = 10f32.powf(-1.0 - 3.0 * number(i, 10));
            photon(p, normal, [t * size, normal.cross(t) * size * number(i, 11)])
        };
        (0..n).map(one).collect()
    };
    let cube = |i| Vec3::new(number(i, 0), number(i, 1), number(i, 2));
    vec![
        ("none", vec![]),
        ("one", make(&|i| (cube(i), Vec3::Z), 1)),
        ("anywhere", make(&|i| (cube(i), warp::sample_sphere([number(i, 3), number(i, 4)].into())), 5000)),
        ("walls", make(&|i| (cube(i) * (Vec3::ONE - axis[(i % 3) as usize]), axis[(i % 3) as usize]), 5000)),
        ("one plane", make(&|i| (cube(i) * Vec3::new(1.0, 0.0, 1.0), Vec3::Y), 5000)),
        ("one line", make(&|i| (Vec3::new(number(i, 0), 0.5, 0.5), Vec3::Y), 1000)),
        ("one point", make(&|_| (Vec3::splat(0.5), Vec3::Y), 1000)),
        ("pairs", make(&|i| (cube(i / 2), Vec3::Y), 1000)),
    ]
}

fn queries(photons: &[Photon]) -> Vec<Vec3> {
    let near = photons.iter().step_by(29).map(|p| p.p);
    let off = photons.iter().step_by(31).map(|p| p.p + Vec3::new(1e-3, 2e-3, -1e-3));
    let grid = (0..100).map(|i| Vec3::new(number(i, 20), number(i, 21), 0.5 * number(i, 22)));
    near.chain(off).chain(grid).chain([Vec3::NAN, Vec3::INFINITY, Vec3::splat(1e30)]).collect()
}

#[test]
fn every_kernel_that_covers_a_point_is_found_once() {
    let widths = Widths { scale: [1.0; 2], min: Smallest::Fixed(1e-5), max: 1.0 };
    for (name, photons) in arrangements() {
        let ellipsoids: Vec<Ellipsoid> = photons.iter().map(|p| widths.ellipsoid(p)).collect();
        let tree = PhotonTree::build(&ellipsoids, |i| i);
        assert_eq!(tree.len(), photons.len());
        let mut found_any = 0;
        for x in queries(&photons) {
            let mut got = Vec::new();
            tree.visit(x, |&i, w| got.push((i, w)));
            got.sort_unstable_by_key(|g| g.0);
            let weights = (0..ellipsoids.len()).map(|i| (i, 1.0 - ellipsoids[i].q(x)));
            // On the border rounding decides.
            let surely: Vec<usize> = weights.clone().filter(|w| w.1 > 1e-4).map(|w| w.0).collect();
            assert!(surely.iter().all(|i| got.iter().any(|g| g.0 == *i)), "{name} {x}");
            assert!(got.windows(2).all(|w| w[0].0 < w[1].0), "{name} {x}: found twice");
            for (i, w) in &got {
                assert!((w - (1.0 - ellipsoids[*i].q(x))).abs() < 1e-4, "{name} {x}");
            }
            found_any += got.len();
        }
        assert!(photons.is_empty() || found_any > 0, "{name}: the test sees nothing");
    }
}

#[test]
fn the_nearest_photons_are_those_that_brute_force_finds() {
    for (name, photons) in arrangements() {
        for k in [2usize, 10, 60] {
            let greatest = 0.3;
            let map = NearestPhotons::build(&photons, k as u32, greatest);
            assert_eq!(map.len(), photons.len());
            for x in queries(&photons) {
                let mut distances: Vec<f64> = photons.iter().map(|p| f64::from((p.p - x).length_squared())).collect();
                distances.sort_by(f64::total_cmp);
                let most = f64::from(greatest * greatest);
                let r2 = if distances.len() >= k && distances[k - 1] <= most { distances[k - 1] } else { most };
                let inside = distances.iter().filter(|d| **d < r2);
                let want: f64 = inside.map(|d| 2.0 / (std::f64::consts::PI * r2) * (1.0 - d / r2)).sum();
                let mut got = 0.0;
                map.visit(x, &mut |_, w| got += f64::from(w));
                if x.is_finite() && r2 > 1e-10 {
                    // A photon on the border is weighted by the rounding of its distance.
                    assert!((got - want).abs() <= 5e-3 * want.max(1.0 / r2), "{name} {k} {x}: {got}, not {want}");
                } else {
                    assert!(!got.is_nan(), "{name} {k} {x}");
                }
            }
        }
    }
}

/// 200,000 photons on one axis-aligned plane build and answer in about the time that scattered ones take: counted in nodes and leaves
/// visited by way of what they cost, bytes of the tree and photons found.
#[test]
fn a_plane_of_photons_is_no_cliff() {
    let n = 200_000;
    let size = 0.002;
    let flat: Vec<Photon> = (0..n)
        .map(|i| photon(Vec3::new(number(i, 0), 0.25, number(i, 1)), Vec3::Y, [Vec3::X * size, Vec3::Z * size]))
        .collect();
    let turn = crate::math::Mat3::from_rotation_x(0.7) * crate::math::Mat3::from_rotation_z(0.4);
    let turned: Vec<Photon> =
        flat.iter().map(|p| photon(turn * p.p, turn * p.n, [turn * p.sigma[0], turn * p.sigma[1]])).collect();
    let seconds = |photons: &[Photon], turn: crate::math::Mat3| {
        let ellipsoids: Vec<Ellipsoid> = photons
            .iter()
            .map(|p| Widths { scale: [2.0; 2], min: Smallest::Fixed(0.0), max: 1.0 }.ellipsoid(p))
            .collect();
        let tree = PhotonTree::build(&ellipsoids, |i| i as u32);
        let start = std::time::Instant::now();
        let mut found = 0;
        for i in 0..20_000 {
            tree.visit(turn * Vec3::new(number(i, 5), 0.25, number(i, 6)), |_, _| found += 1);
        }
        (start.elapsed().as_secs_f64(), found)
    };
    let (a, b) = (seconds(&flat, crate::math::Mat3::IDENTITY), seconds(&turned, turn));
    assert!((a.1 as f64 / b.1 as f64 - 1.0).abs() < 0.01, "{} {}", a.1, b.1);
    // Ten times leaves room for a loaded machine; a degenerate tree would be slower by thousands.
    assert!(a.0 < 10.0 * b.0 + 0.05, "{} s on the plane, {} s turned", a.0, b.0);
}
