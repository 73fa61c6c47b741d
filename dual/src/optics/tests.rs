//! Derivatives of whole chains (two refractions, a mirror with interpolated normals, a last surface) against central differences,
//! and values of dual instances against the plain one, bit for bit.

use num_dual::{Dual2SVec64, DualSVec64};

use super::*;
use crate::testkit::Rng;
use crate::{Cylinder, Disk, Family, Jet, Plane, Ray, Root, Sphere, Triangle, Vec3};

/// Grazing limit for |d.n| and the transmitted cosine.
const GRAZING: f64 = 0.05;

#[derive(Clone, Copy)]
enum Last {
    Plane(Plane<f64>),
    Sphere(Sphere<f64>, Root),
    Cylinder(Cylinder<f64>),
    Disk(Disk<f64>),
}

/// Glass ball, mirror triangle with vertex normals, last surface.
#[derive(Clone, Copy)]
struct Chain {
    ball: Sphere<f64>,
    eta: f64,
    mirror: Triangle<f64>,
    normals: [Vec3<f64>; 3],
    last: Last,
}

/// Smallest cosine met on the way decides whether a chain counts as grazing.
#[derive(Clone, Copy)]
struct Walk<T> {
    point: Vec3<T>,
    dir: Vec3<T>,
    min_cos: f64,
}

fn cos<T: crate::Real<Primitive = f64>>(d: Vec3<T>, n: Vec3<T>) -> f64 {
    (d.re().dot(n.re()) / (d.re().norm() * n.re().norm())).abs()
}

/// Through the ball: refraction in, refraction out. The ray that leaves, and the smallest cosine.
fn through_ball<T: crate::Real<Primitive = f64>>(ray: Ray<T>, ball: &Sphere<f64>, eta: f64) -> Option<(Ray<T>, f64)> {
    let p = ray.at(ball.t(&ray, Root::Near));
    let n = ball.normal(p);
    let inside = Ray::new(p, refract(ray.d, n, 1.0 / eta).direction?);
    let q = inside.at(ball.t(&inside, Root::Far));
    let m = -ball.normal(q);
    let out = Ray::new(q, refract(inside.d, m, eta).direction?);
    let c = cos(ray.d, n).min(cos(inside.d, n)).min(cos(inside.d, m)).min(cos(out.d, m));
    Some((out, c))
}

impl Chain {
    fn walk<T: crate::Real<Primitive = f64>>(&self, ray: Ray<T>) -> Option<Walk<T>> {
        let (out, c) = through_ball(ray, &self.ball, self.eta)?;
        let p = out.at(self.mirror.t(&out));
        let n = interpolate_normal(self.mirror.barycentrics(p), self.normals);
        let refl = Ray::new(p, reflect(out.d, n));
        let (t, m) = match &self.last {
            Last::Plane(s) => (s.t(&refl), Vec3::lift(s.normal)),
            Last::Disk(s) => (s.t(&refl), Vec3::lift(s.normal)),
            Last::Sphere(s, root) => {
                let t = s.t(&refl, *root);
                (t, s.normal(refl.at(t)))
            }
            Last::Cylinder(s) => {
                let t = s.t(&refl, Root::Near);
                (t, s.normal(refl.at(t)))
            }
        };
        let c = c.min(cos(out.d, Vec3::lift(self.mirror.normal()))).min(cos(refl.d, m));
        Some(Walk { point: refl.at(t), dir: reflect(refl.d, m.normalized()), min_cos: c })
    }

    /// A chain built along a real ray, so that nothing is missed.
    fn random<const N: usize>(rng: &mut Rng, family: &Family<f64, N>) -> Option<Chain> {
        let ray = Ray::new(family.o, family.d);
        let reach = rng.range(2.0, 6.0) / ray.d.norm();
        let ball = Sphere::new(ray.at(reach) + rng.cube(0.6), rng.range(0.7, 1.3));
        ball.hit(&ray, 0.0, 1e9)?;
        if !ball.is_outside(ray.o) {
            return None;
        }
        let eta = rng.range(1.2, 1.8);
        let (out, _) = through_ball(ray, &ball, eta)?;
        let at = out.at(rng.range(1.0, 3.0) / out.d.norm());
        let mirror = Triangle::new(at + rng.cube(2.0), at + rng.cube(2.0), at + rng.cube(2.0));
        if mirror.area_normal().norm() < 1.0 {
            return None;
        }
        let face = mirror.normal();
        let normals = std::array::from_fn(|_| (face + rng.cube(0.2)).normalized());
        let p = out.at(mirror.t(&out));
        // Chains that leave the neighbourhood of the triangle extrapolate its normals without limit.
        if (p - at).norm() > 3.0 {
            return None;
        }
        let n = interpolate_normal(mirror.barycentrics(p), normals);
        let refl = Ray::new(p, reflect(out.d, n));
        let end = refl.at(rng.range(1.0, 4.0) / refl.d.norm());
        let last = match rng.bits() % 4 {
            0 => Last::Plane(Plane::new(end, rng.direction())),
            1 => Last::Disk(Disk::new(end, rng.direction() * rng.range(0.5, 2.0), 1.0)),
            2 => {
                let s = Sphere::new(end + rng.cube(0.5), 1.0);
                Last::Sphere(s, s.hit(&refl, 0.0, 1e9)?.1)
            }
            _ => {
                let a = rng.direction();
                let s = Cylinder::new(end - a + rng.cube(0.3), end + a, 0.8);
                Last::Cylinder(if s.discriminant(&refl) > 0.0 { s } else { return None })
            }
        };
        let chain = Chain { ball, eta, mirror, normals, last };
        (chain.walk(ray)?.min_cos > GRAZING).then_some(chain)
    }
}

fn outputs<T: Copy>(w: &Walk<T>) -> [T; 6] {
    let ([a, b, c], [d, e, f]) = (w.point.to_array(), w.dir.to_array());
    [a, b, c, d, e, f]
}

/// Five-point central difference (error h^4) of all outputs along one parameter.
fn difference<const N: usize>(
    f: impl Fn(&Family<f64, N>, [f64; N]) -> Option<[f64; 6]>,
    family: &Family<f64, N>,
    k: usize,
    h: f64,
) -> Option<[f64; 6]> {
    let at = |s: f64| {
        let mut p = [0.0; N];
        p[k] = s * h;
        f(family, p)
    };
    let (a, b, c, d) = (at(-2.0)?, at(-1.0)?, at(1.0)?, at(2.0)?);
    Some(std::array::from_fn(|i| (8.0 * (c[i] - b[i]) - (d[i] - a[i])) / (12.0 * h)))
}

/// Error relative to the length of the derivative vector.
fn relative(a: [f64; 3], b: [f64; 3]) -> f64 {
    let norm = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    norm([a[0] - b[0], a[1] - b[1], a[2] - b[2]]) / norm(b).max(1e-3) // below that rounding of the differences shows
}

fn halves(v: [f64; 6]) -> [[f64; 3]; 2] {
    [[v[0], v[1], v[2]], [v[3], v[4], v[5]]]
}

#[test]
fn first_derivatives_of_chains_agree_with_central_differences() {
    let wanted = 100_000;
    let (mut rng, mut done, mut worst) = (Rng::new(7), 0, 0.0f64);
    while done < wanted {
        let o = rng.cube(1.0);
        let d = rng.direction() * rng.range(0.5, 2.0);
        // Every second family moves its origin as well.
        let o_p = if done % 2 == 0 { [Vec3::zero(); 2] } else { [rng.cube(0.5), rng.cube(0.5)] };
        let family = Family::<f64, 2>::new(o, o_p, d, [rng.cube(0.5), rng.cube(0.5)]);
        let Some(chain) = Chain::random(&mut rng, &family) else {
            continue;
        };
        let dual = chain.walk(family.ray::<DualSVec64<2>>()).expect("takes the plain path");
        let plain = |f: &Family<f64, 2>, p| chain.walk(f.at(p)).map(|w| outputs(&w));
        // Features of a chain scale with its smallest cosine.
        let h = 1e-4 * chain.walk(family.ray::<f64>()).unwrap().min_cos.min(0.3);
        // A chain counts if its neighbours take the same path, for both parameters.
        let [Some(x), Some(y)] = [0, 1].map(|k| difference(plain, &family, k, h)) else {
            continue;
        };
        for (k, fd) in [x, y].into_iter().enumerate() {
            let ad = outputs(&dual).map(|x| x.gradient()[k]);
            for (a, b) in halves(ad).into_iter().zip(halves(fd)) {
                worst = worst.max(relative(a, b));
            }
        }
        done += 1;
    }
    println!("largest relative error of first derivatives over {wanted} chains: {worst:.2e}");
    assert!(worst < 1e-6, "{worst:e}");
}

#[test]
fn second_and_four_parameter_derivatives_agree_with_differences() {
    let wanted = 10_000;
    let (mut rng, mut done, mut worst4, mut worst2) = (Rng::new(8), 0, 0.0f64, 0.0f64);
    while done < wanted {
        let family = Family::between(
            rng.cube(1.0),
            [rng.cube(0.3), rng.cube(0.3)],
            rng.direction() * 3.0,
            [rng.cube(0.5), rng.cube(0.5)],
        );
        let Some(chain) = Chain::random(&mut rng, &family) else {
            continue;
        };
        let h = 1e-4 * chain.walk(family.ray::<f64>()).unwrap().min_cos.min(0.3);
        let dual = outputs(&chain.walk(family.ray::<DualSVec64<4>>()).unwrap());
        for k in 0..4 {
            let plain = |f: &Family<f64, 4>, p| chain.walk(f.at(p)).map(|w| outputs(&w));
            let Some(fd) = difference(plain, &family, k, h) else {
                continue;
            };
            for (a, b) in halves(dual.map(|x| x.gradient()[k])).into_iter().zip(halves(fd)) {
                worst4 = worst4.max(relative(a, b));
            }
        }
        // Hessian: central differences of the dual gradient, in the two parameters that aim.
        let aim = Family::<f64, 2>::fixed(family.o, family.d, [family.d_p[2], family.d_p[3]]);
        let second = outputs(&chain.walk(aim.ray::<Dual2SVec64<2>>()).unwrap());
        for (i, k) in [(0, 0), (0, 1), (1, 1)] {
            let gradient = |f: &Family<f64, 2>, p: [f64; 2]| {
                let shifted = f.cell(p, [1.0, 1.0]);
                chain.walk(shifted.ray::<DualSVec64<2>>()).map(|w| outputs(&w).map(|x| x.gradient()[i]))
            };
            let Some(fd) = difference(gradient, &aim, k, h) else {
                continue;
            };
            for (a, b) in halves(second.map(|x| x.hessian()[i][k])).into_iter().zip(halves(fd)) {
                worst2 = worst2.max(relative(a, b));
            }
        }
        done += 1;
    }
    println!("largest relative error: 4 parameters {worst4:.2e}, Hessian {worst2:.2e}");
    assert!(worst4 < 1e-6 && worst2 < 1e-5, "{worst4:e} {worst2:e}");
}

#[test]
fn a_wrong_derivative_would_be_seen() {
    // The comparison itself must be able to fail: drop the normal's derivative in the reflection.
    let mut rng = Rng::new(9);
    let (family, chain) = loop {
        let family = Family::<f64, 2>::fixed(rng.cube(1.0), rng.direction(), [rng.cube(0.5), rng.cube(0.5)]);
        if let Some(chain) = Chain::random(&mut rng, &family) {
            break (family, chain);
        }
    };
    let ray = family.ray::<DualSVec64<2>>();
    let p = ray.at(chain.ball.t(&ray, Root::Near));
    let wrong = reflect(ray.d, Vec3::lift(chain.ball.normal(p).re()));
    let right = reflect(ray.d, chain.ball.normal(p));
    let grad = |v: Vec3<DualSVec64<2>>| v.to_array().map(|c| c.gradient()[0]);
    assert!(relative(grad(wrong), grad(right)) > 1e-3);
}

#[test]
fn values_equal_the_plain_instance_bit_for_bit() {
    let (mut rng, mut done) = (Rng::new(10), 0);
    while done < 5_000 {
        let family = Family::<f64, 2>::fixed(rng.cube(1.0), rng.direction(), [rng.cube(0.5), rng.cube(0.5)]);
        let Some(chain) = Chain::random(&mut rng, &family) else {
            continue;
        };
        let plain = outputs(&chain.walk(family.ray::<f64>()).unwrap());
        let first = outputs(&chain.walk(family.ray::<DualSVec64<2>>()).unwrap()).map(|x| x.re);
        let second = outputs(&chain.walk(family.ray::<Dual2SVec64<2>>()).unwrap()).map(|x| x.re);
        assert_eq!(plain.map(f64::to_bits), first.map(f64::to_bits));
        assert_eq!(plain.map(f64::to_bits), second.map(f64::to_bits));
        done += 1;
    }
}

#[test]
fn closed_forms_of_the_differentials() {
    let mut rng = Rng::new(11);
    for _ in 0..1000 {
        let (d, n) = (rng.direction(), rng.direction());
        let n = if d.dot(n) > 0.0 { -n } else { n };
        let (d1, eta) = (rng.cube(1.0), rng.range(0.6, 1.0));
        // A unit normal that turns: n1 perpendicular to n.
        let n1 = rng.cube(1.0).cross(n);
        let lift = |v: Vec3<f64>, g: Vec3<f64>| Vec3 {
            x: DualSVec64::<1>::jet(v.x, [g.x]),
            y: DualSVec64::<1>::jet(v.y, [g.y]),
            z: DualSVec64::<1>::jet(v.z, [g.z]),
        };
        let (dd, nn) = (lift(d, d1), lift(n, n1));
        let dn = d.dot(n);
        let dn1 = d1.dot(n) + d.dot(n1);
        let refl = d1 - (n1 * dn + n * dn1) * 2.0;
        assert!((reflect(dd, nn).partial(0) - refl).norm() < 1e-13);
        // Refraction: the general form, |d| free to change along the parameter.
        let r = refract(dd, nn, eta);
        let (c, c1) = (-dn, -dn1);
        let k = 1.0 - eta * eta * (1.0 - c * c);
        let k1 = 2.0 * d.dot(d1) * (1.0 - eta * eta) + 2.0 * eta * eta * c * c1;
        let mu = eta * c - k.sqrt();
        let want = d1 * eta + n1 * mu + n * (eta * c1 - k1 / (2.0 * k.sqrt()));
        assert!((r.margin.re - k).abs() < 1e-14);
        assert!((r.direction.unwrap().partial(0) - want).norm() < 1e-11);
        assert!((r.direction.unwrap().re().norm() - 1.0).abs() < 1e-14);
    }
}
