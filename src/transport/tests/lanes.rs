//! Irradiance from leaves against the same sum photon by photon.

use super::*;
use crate::transport::eight::Eight;
use crate::transport::footprint_kernel::{Ellipsoid, Smallest, Widths};
use crate::transport::obstacle::{NONE, Obstacles};
use crate::transport::photon_lanes::{Arrival, PhotonLanes, Query};
use crate::transport::photon_map::NORMAL_CONE;
use crate::transport::photon_tree::PhotonTree;

fn number(i: u64, k: u64) -> f32 {
    crate::math::sampler::unit_f32(crate::math::sampler::hash(i, k))
}

/// `n` kernels anywhere in the unit cube, of all sizes and orientations, and what arrives there.
fn photons(n: u64) -> (Vec<Ellipsoid>, Vec<Arrival>) {
    let widths = Widths { scale: [1.0; 2], min: Smallest::Fixed(1e-3), max: 0.5 };
    let one = |i| {
        let normal = warp::sample_sphere([number(i, 3), number(i, 4)].into());
        let t = normal.any_orthonormal_vector();
        let size = 10f32.powf(-0.5 - 2.0 * number(i, 5));
        let p = Vec3::new(number(i, 0), number(i, 1), number(i, 2));
        let e = widths.ellipsoid(&super::kernel::photon(p, normal, [t * size, normal.cross(t) * size * number(i, 6)]));
        let power = Rgb::new(number(i, 7), number(i, 8), number(i, 9));
        let segments = 1 + (number(i, 10) * 6.0) as u32;
        let shading = number(i, 11);
        (e, Arrival { power, wi: normal, n: normal, shading, segments, obstacle: NONE, clear: 0.0 })
    };
    (0..n).map(one).unzip()
}

/// The sum at `x` in f64.
fn brute(e: &[Ellipsoid], a: &[Arrival], x: Vec3, n: Vec3, most: u32) -> f64 {
    let counts = |a: &Arrival| a.n.dot(n) >= NORMAL_CONE && a.segments <= most;
    let one = |(e, a): (&Ellipsoid, &Arrival)| f64::from(1.0 - e.q(x)).max(0.0) * f64::from(a.power.y * a.shading);
    e.iter().zip(a).filter(|(_, a)| counts(a)).map(one).sum()
}

#[test]
fn eight_at_a_time_is_one_at_a_time() {
    // Numbers that fill leaves, and numbers that leave lanes without a photon.
    for n in [1, 7, 8, 9, 64, 3001] {
        let (e, a) = photons(n);
        let tree = PhotonTree::build(&e, |i| a[i]);
        let lanes = PhotonLanes::new(&tree);
        let mut lit = 0;
        for i in 0..300 {
            let k = 1000 + i;
            let x =
                if i % 2 == 0 { e[(i % n) as usize].p } else { Vec3::new(number(k, 0), number(k, 1), number(k, 2)) };
            let normal = warp::sample_sphere([number(k, 3), number(k, 4)].into());
            for most in [3, u32::MAX] {
                let want = brute(&e, &a, x, normal, most);
                let got = f64::from(lanes.irradiance(&tree, &Obstacles::default(), &Query { x, n: normal, most }).y);
                assert!((got - want).abs() <= 1e-4 * want + 1e-4, "{n} {x}: {got}, not {want}");
                lit += usize::from(want > 0.01);
            }
        }
        assert!(n < 64 || lit > 50, "{n}: the test sees nothing");
        // What the sum is told of normals and lengths matters.
        let all: f64 = brute(&e, &a, e[0].p, a[0].n, u32::MAX);
        assert!(n < 64 || brute(&e, &a, e[0].p, -a[0].n, u32::MAX) != all);
    }
}

/// The vector units of this processor against four lanes at a time: the same bits. (Without AVX2 both are the same.)
#[test]
fn any_vector_units_give_the_same_bits() {
    let (e, a) = photons(3001);
    let tree = PhotonTree::build(&e, |i| a[i]);
    let lanes = PhotonLanes::new(&tree);
    let (mut lit, mut darker) = (0, 0);
    for i in 0..1000 {
        let x = e[i].p + Vec3::new(number(i as u64, 20), number(i as u64, 21), number(i as u64, 22)) * 0.05;
        let query = Query { x, n: a[i].n, most: 4 };
        let wide = lanes.irradiance(&tree, &Obstacles::default(), &query);
        let narrow = lanes.sum::<Eight>(&tree, &Obstacles::default(), &query);
        assert_eq!(wide.to_array().map(f32::to_bits), narrow.to_array().map(f32::to_bits), "{x}");
        lit += usize::from(wide.y > 0.01);
        // Other lanes in the sum: the comparison can tell.
        let other = lanes.sum::<Eight>(&tree, &Obstacles::default(), &Query { most: 1, ..query });
        assert!(other.y <= narrow.y);
        darker += usize::from(other.y < narrow.y);
    }
    assert!(lit > 500 && darker > 100, "{lit} {darker}: the test sees nothing");
}

#[test]
fn points_that_are_no_numbers_get_nothing() {
    let (e, a) = photons(100);
    let tree = PhotonTree::build(&e, |i| a[i]);
    let lanes = PhotonLanes::new(&tree);
    for x in [Vec3::NAN, Vec3::INFINITY, Vec3::new(f32::NAN, 0.5, 0.5), Vec3::splat(1e30)] {
        assert_eq!(
            lanes.irradiance(&tree, &Obstacles::default(), &Query { x, n: Vec3::Y, most: u32::MAX }),
            Rgb::ZERO,
            "{x}"
        );
    }
}
