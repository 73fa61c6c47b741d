//! Ranges against dense evaluation.

use super::*;
use crate::testkit::Rng;

fn random<const N: usize>(rng: &mut Rng) -> Expansion<f64, N> {
    let mut h = [[0.0; N]; N];
    for i in 0..N {
        for j in 0..=i {
            h[i][j] = rng.range(-2.0, 2.0);
            h[j][i] = h[i][j];
        }
    }
    let gradient = std::array::from_fn(|_| rng.range(-2.0, 2.0));
    Expansion { order: 2, value: rng.range(-1.0, 1.0), gradient, hessian: h }
}

#[test]
fn range_over_the_square_is_tight() {
    let mut rng = Rng::new(1);
    let n = 100;
    for _ in 0..500 {
        let m = random::<2>(&mut rng);
        let (lo, hi) = range(&m);
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..=n {
            for j in 0..=n {
                let v = m.at([i, j].map(|k| k as f64 / n as f64 * 2.0 - 1.0));
                least = least.min(v);
                most = most.max(v);
            }
        }
        // The grid misses an extremum by at most 1/2 |H| h^2 on each axis, h = 1/100.
        assert!(lo <= least + 1e-14 && lo > least - 1e-3, "{lo} {least}");
        assert!(hi >= most - 1e-14 && hi < most + 1e-3, "{hi} {most}");
    }
}

#[test]
fn range_in_four_parameters_contains_every_value() {
    let mut rng = Rng::new(2);
    for _ in 0..500 {
        let m = random::<4>(&mut rng);
        let ((lo, hi), (lo1, hi1)) = (range(&m), range(&m.first_order()));
        for _ in 0..200 {
            let p = std::array::from_fn(|_| rng.range(-1.0, 1.0));
            assert!(m.at(p) >= lo && m.at(p) <= hi);
            let first = m.first_order().at(p);
            assert!(first >= lo1 && first <= hi1);
        }
    }
    // Without mixed terms the bound is attained.
    let m = Expansion::<f64, 4> { order: 2, value: 0.0, gradient: [0.0; 4], hessian: [[0.0; 4]; 4] };
    let m =
        Expansion { hessian: std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 2.0 } else { 0.0 })), ..m };
    assert_eq!(range(&m), (0.0, 4.0));
}

#[test]
fn degenerate_quadratics() {
    // A parabolic valley (singular Hessian) with its minimum along a line inside the square.
    let m = Expansion { order: 2, value: 0.1, gradient: [0.0, 0.0], hessian: [[2.0, -2.0], [-2.0, 2.0]] };
    let lo: f64 = range(&m).0;
    assert!((lo - 0.1).abs() < 1e-15);
    // Linear after all.
    let m = Expansion { order: 2, value: 3.0, gradient: [1.0, -1.0], hessian: [[0.0; 2]; 2] };
    assert_eq!(range(&m), (1.0, 5.0));
    // Nothing known: never "clear".
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(bounds(&Expansion { gradient: [bad, 0.0], ..m }));
        assert!(corners(&Expansion { value: bad, ..m }, Neighbours::Corners));
    }
    assert_eq!(Expansion { order: 1, value: 1.0, gradient: [3.0, 4.0], hessian: [[0.0; 2]; 2] }.distance(), 0.2);
}

#[test]
fn neighbours() {
    let at = |value, gradient| Expansion { order: 1, value, gradient, hessian: [[0.0; 2]; 2] };
    // Cuts one corner only: seen by corners, not by sides.
    let m = at(1.5, [1.0, 1.0]);
    assert!(corners(&m, Neighbours::Corners) && !corners(&m, Neighbours::Sides));
    assert!(corners(&m, Neighbours::CornersAndSides) && bounds(&m));
    // A thin slab between two parallel lines, inside of which no neighbour lies.
    let slab = [at(-0.45, [1.0, 0.0]), at(0.55, [-1.0, 0.0])];
    assert!(!corners_inside(&slab, Neighbours::CornersAndSides));
    assert!(slab.iter().all(bounds));
    // Guards.
    let behind = Guarded { margin: at(0.0, [1.0, 0.0]), guard: at(-1.0, [0.2, 0.2]) };
    assert!(!behind.flags(Test::Bounds) && !behind.flags(Test::Corners(Neighbours::Corners)));
    let front = Guarded { guard: at(1.0, [0.2, 0.2]), ..behind };
    assert!(front.flags(Test::Bounds) && front.flags(Test::Corners(Neighbours::Corners)));
}
