//! What derivatives cost: time of each kernel in dual numbers as a ratio to the plain f64 instance, best of several runs.
//!
//! Columns: plain time per ray; ratios for first order in 2 parameters, first order in 4 (origin moving as well) and second order
//! in 2. The plain kernels are vectorised by the compiler where they are small, the dual ones are not.
//!
//! `cargo run --release -p dualux-dual --example cost`

use std::hint::black_box;
use std::time::Instant;

use dualux_dual::num_dual::{Dual2SVec64, DualSVec64};
use dualux_dual::testkit::Rng;
use dualux_dual::{
    Cylinder, Disk, Family, Jet, Ray, Rectangle, Root, Sphere, Triangle, Vec3, bounds, margins, reflect, refract, vec3,
};

const RAYS: usize = 4096;

/// Best time per ray in ns, over repeated runs, of `f` applied to the centre ray of each family in type T.
#[inline(always)]
fn time<T: Jet<N, Primitive = f64>, const N: usize>(
    families: &[Family<f64, N>],
    fixed: bool,
    f: impl Fn(Ray<T>) -> T,
) -> f64 {
    (0..30)
        .map(|_| {
            let start = Instant::now();
            for family in families {
                let family = black_box(family);
                black_box(f(if fixed { family.fixed_ray() } else { family.ray() }));
            }
            start.elapsed().as_nanos() as f64 / families.len() as f64
        })
        .fold(f64::INFINITY, f64::min)
}

macro_rules! kernel {
    ($name:expr, $two:expr, $four:expr, |$ray:ident| $body:expr) => {{
        let plain = time::<f64, 2>(&$two, true, |$ray| $body);
        let first = time::<DualSVec64<2>, 2>(&$two, true, |$ray| $body);
        let four = time::<DualSVec64<4>, 4>(&$four, false, |$ray| $body);
        let second = time::<Dual2SVec64<2>, 2>(&$two, true, |$ray| $body);
        println!(
            "{:<34} {:>7.1} ns   {:>5.2}   {:>5.2}   {:>5.2}",
            $name,
            plain,
            first / plain,
            four / plain,
            second / plain
        );
    }};
}

fn sum<T: dualux_dual::Real>(v: Vec3<T>) -> T {
    v.x + v.y + v.z
}

fn main() {
    let mut rng = Rng::new(1);
    let two: Vec<_> = (0..RAYS)
        .map(|_| {
            let o = rng.cube(0.5);
            let aim = vec3(0.0, 0.0, 5.0) + rng.cube(0.5) - o;
            rng.family(o, aim, 0.02)
        })
        .collect();
    let four: Vec<_> =
        two.iter().map(|f| Family::between(f.o, [rng.cube(0.01), rng.cube(0.01)], f.o + f.d, f.d_p)).collect();
    let ball = Sphere::new(vec3(0.0, 0.0, 5.0), 1.5);
    let tri = Triangle::new(vec3(-3.0, -3.0, 5.0), vec3(3.0, -3.0, 5.5), vec3(0.0, 4.0, 4.5));
    let wall = Rectangle::new(vec3(0.0, 0.0, -9.0), vec3(9.0, 0.0, 0.0), vec3(0.0, 9.0, 0.0));
    let disk = Disk::new(vec3(0.0, 0.0, 5.0), vec3(0.1, 0.2, 1.0), 1.0);
    let tube = Cylinder::new(vec3(-1.0, 0.0, 5.0), vec3(1.0, 0.5, 5.0), 0.7);

    println!("{:<34} {:>10}   {:>5}   {:>5}   {:>5}", "kernel (camera ray included)", "f64", "1st/2", "1st/4", "2nd/2");
    kernel!("sphere, hit", two, four, |r| ball.hit(&r, 0.0, 1e9).map_or_else(|| r.d.x, |h| h.0));
    kernel!("triangle, hit", two, four, |r| tri.hit(&r, 0.0, 1e9).unwrap_or(r.d.x));
    kernel!("known triangle, point", two, four, |r| sum(r.at(tri.t(&r))));
    kernel!("cylinder, hit", two, four, |r| tube.hit(&r, 0.0, 1e9).map_or_else(|| r.d.x, |h| h.0));
    kernel!("margin of an edge", two, four, |r| margins::line(&r, tri.a, tri.b));
    kernel!("margin of a sphere", two, four, |r| margins::sphere(&r, &ball));
    kernel!("margin of a rim", two, four, |r| margins::rim(&r, &disk));
    kernel!("mirror ball, wall", two, four, |r| {
        let p = r.at(ball.t(&r, Root::Near));
        let out = Ray::new(p, reflect(r.d, ball.normal(p)));
        sum(out.at(wall.t(&out)))
    });
    kernel!("glass ball (2 refractions), wall", two, four, |r| {
        let p = r.at(ball.t(&r, Root::Near));
        let d = refract(r.d, ball.normal(p), 1.0 / 1.5).direction.unwrap_or(r.d);
        let inside = Ray::new(p, d);
        let q = inside.at(ball.t(&inside, Root::Far));
        let d = refract(d, -ball.normal(q), 1.5).direction.unwrap_or(d);
        let out = Ray::new(q, d);
        sum(out.at(wall.t(&out)))
    });
    let clip = |f: &Family<f64, 2>| margins::Projector::new(f).and_then(|p| p.clip(tri.a, tri.b)).is_some();
    let run = |f: &dyn Fn(&Family<f64, 2>)| {
        (0..30)
            .map(|_| {
                let start = Instant::now();
                two.iter().for_each(f);
                start.elapsed().as_nanos() as f64 / RAYS as f64
            })
            .fold(f64::INFINITY, f64::min)
    };
    println!(
        "projector and one chord            {:>7.1} ns",
        run(&|f| {
            black_box(clip(black_box(f)));
        })
    );
    println!(
        "2nd-order sphere margin + bounds   {:>7.1} ns",
        run(&|f| {
            black_box(bounds(&margins::sphere(&black_box(f).fixed_ray::<Dual2SVec64<2>>(), &ball).expansion()));
        })
    );
    println!(
        "1st-order edge margin + bounds     {:>7.1} ns",
        run(&|f| {
            black_box(bounds(&margins::line(&black_box(f).fixed_ray::<DualSVec64<2>>(), tri.a, tri.b).expansion()));
        })
    );
}
