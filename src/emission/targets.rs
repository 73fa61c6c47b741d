//! Spheres round parts of the shapes of interest: what the disks of a light at infinity are drawn across.
//!
//! A disk round everything of interest is met by most rays in vain, and what a small object receives is a curved sheet in primary-sample space,
//! since its place on the disk moves as directions turn. From a disk round the object itself all rays count, and which of them
//! are hidden is nearly a matter of direction alone: easily learned (`learned`). So triangles and analytic shapes are divided into
//! clusters, top-down in the middle, while that makes the disks smaller (sum of r^2) or until there are [`MOST`].
//!
//! Every ray that meets a shape of interest meets a sphere, and belongs to the smallest one that it meets: the disks of the others leave it
//! out, so that each ray is emitted from one disk only.
//! Source: projection maps (Jensen 2001, section 7.3.1) draw bounding spheres of objects as here; the clusters are those of a bounding-volume hierarchy.
//! Bias: none: spheres enclose all that is wanted. Verified by `tests/learned.rs`.

use crate::math::DVec3;
use crate::scene::{Geometry, Scene};

/// Clusters at most: each ray is held against all of them.
const MOST: usize = 48;
/// Clusters take the place of one if the sum of their r^2 is below this part of it; less if they would be too many.
const WORTH: f64 = 0.8;
/// Clusters of less than this part of the radius of all are not divided, nor those that come from so many divisions.
const SMALL: f64 = 0.02;
/// Parts that a mesh is taken for, at most: consecutive triangles, which mostly are neighbours.
const MOST_PARTS: usize = 1 << 16;
const DEEPEST: u32 = 24;

/// A sphere round a cluster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Target {
    /// Centre.
    pub centre: DVec3,
    /// Radius.
    pub radius: f64,
    /// How much its surfaces turn: 0 if all are parallel, 1 if normals point everywhere alike.
    pub curved: f64,
}

/// Some triangles, or an analytic shape.
#[derive(Clone, Copy)]
struct Part {
    lo: DVec3,
    hi: DVec3,
    /// Radius round the middle.
    round: f64,
    /// Integral of the outer product of the normal with itself over its area: xx, yy, zz, xy, xz, yz.
    turn: [f64; 6],
}

impl Part {
    /// Both.
    fn and(self, other: Part) -> Part {
        let (lo, hi) = (self.lo.min(other.lo), self.hi.max(other.hi));
        let turn = std::array::from_fn(|k| self.turn[k] + other.turn[k]);
        Part { lo, hi, round: 0.5 * (hi - lo).length(), turn }
    }
}

fn outer(n: DVec3, area: f64) -> [f64; 6] {
    [n.x * n.x, n.y * n.y, n.z * n.z, n.x * n.y, n.x * n.z, n.y * n.z].map(|x| x * area)
}

fn parts(scene: &Scene, wanted: &[bool]) -> Vec<Part> {
    let mut parts = Vec::new();
    for (shape, _) in scene.shapes.iter().zip(wanted).filter(|(_, w)| **w) {
        if let Geometry::Mesh(mesh) = &shape.geometry {
            let triangle = |t: u32| {
                let [a, b, c] = mesh.corners(t).map(|p| p.as_dvec3());
                let n = (b - a).cross(c - a);
                let area = 0.5 * n.length();
                let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
                Part { lo, hi, round: 0.5 * (hi - lo).length(), turn: outer(n.normalize_or_zero(), area) }
            };
            let triangles = mesh.triangles.len() as u32;
            let size = triangles.div_ceil(MOST_PARTS as u32).max(1);
            let first = (0..triangles).step_by(size as usize);
            let together = |t: u32| (t + 1..(t + size).min(triangles)).map(triangle).fold(triangle(t), Part::and);
            parts.extend(first.map(together));
            continue;
        }
        let (lo, hi) = shape.bounds();
        let area = f64::from(shape.area());
        let turn = match &shape.geometry {
            Geometry::Rectangle(r) => outer(r.n.as_dvec3(), area),
            Geometry::Disk(d) => outer(d.n.as_dvec3(), area),
            Geometry::Cylinder(c) => {
                let [x, y] = [c.reference, c.binormal].map(|v| outer(v.as_dvec3(), 0.5 * area));
                std::array::from_fn(|k| x[k] + y[k])
            }
            Geometry::Sphere(_) | Geometry::Mesh(_) => [1.0, 1.0, 1.0, 0.0, 0.0, 0.0].map(|x| x * area / 3.0),
        };
        let (lo, hi) = (lo.as_dvec3(), hi.as_dvec3());
        let round = match &shape.geometry {
            Geometry::Sphere(_) => 0.5 * (hi - lo).max_element(),
            _ => 0.5 * (hi - lo).length(),
        };
        parts.push(Part { lo, hi, round, turn });
    }
    parts
}

/// The sphere of a cluster, which has a part at least.
fn target(parts: &[Part]) -> Target {
    let (mut lo, mut hi, mut turn) = (parts[0].lo, parts[0].hi, [0.0; 6]);
    for part in parts {
        lo = lo.min(part.lo);
        hi = hi.max(part.hi);
        turn.iter_mut().zip(&part.turn).for_each(|(sum, x)| *sum += x);
    }
    let centre = 0.5 * (lo + hi);
    // As far as the corners of all boxes reach, or what is round in them.
    let farthest = |p: &Part| {
        let corner = (p.lo - centre).abs().max((p.hi - centre).abs()).length();
        corner.min((0.5 * (p.lo + p.hi) - centre).length() + p.round)
    };
    let radius = parts.iter().map(farthest).fold(0.0, f64::max) * (1.0 + 1e-6);
    // The sum of the squares of a matrix's entries is that of its eigenvalues: 1 for one direction, 1/3 for all alike.
    let area = (turn[0] + turn[1] + turn[2]).max(f64::MIN_POSITIVE);
    let squares = turn.map(|x| (x / area).powi(2));
    let one = squares[..3].iter().sum::<f64>() + 2.0 * squares[3..].iter().sum::<f64>();
    Target { centre, radius, curved: (1.5 * (1.0 - one)).clamp(0.0, 1.0) }
}

/// A cluster and the first of the two that it is divided into; 0: none.
struct Node {
    target: Target,
    children: usize,
}

/// Spheres that enclose all wanted shapes, the smallest first; none if there are none.
pub(super) fn targets(scene: &Scene, wanted: &[bool]) -> Vec<Target> {
    let mut all = parts(scene, wanted);
    if all.is_empty() {
        return Vec::new();
    }
    let mut nodes = vec![Node { target: target(&all), children: 0 }];
    let least = SMALL * nodes[0].target.radius;
    let mut waiting = vec![(0, 0, all.len(), 0)];
    while let Some((i, begin, end, depth)) = waiting.pop() {
        let open = depth < DEEPEST && nodes[i].target.radius > least;
        let Some(at) = divided(&mut all[begin..end]).filter(|_| open) else { continue };
        let first = nodes.len();
        nodes[i].children = first;
        for (k, (b, e)) in [(begin, begin + at), (begin + at, end)].into_iter().enumerate() {
            nodes.push(Node { target: target(&all[b..e]), children: 0 });
            waiting.push((first + k, b, e, depth + 1));
        }
    }
    let mut worth = WORTH;
    let mut chosen = worthwhile(&nodes, worth);
    while chosen.len() > MOST {
        worth *= 0.8;
        chosen = worthwhile(&nodes, worth);
    }
    let key = |t: &Target| [t.radius, t.centre.x, t.centre.y, t.centre.z];
    chosen.sort_by(|a, b| {
        let pairs = key(a).into_iter().zip(key(b)).map(|(x, y)| x.total_cmp(&y));
        pairs.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
    });
    chosen
}

/// The clusters of the tree that are worth being divided no more.
fn worthwhile(nodes: &[Node], worth: f64) -> Vec<Target> {
    // Children come behind their parents. Sum of r^2 of the best division of each, and whether it is one.
    let mut best: Vec<(f64, bool)> = vec![(0.0, false); nodes.len()];
    for (i, node) in nodes.iter().enumerate().rev() {
        let whole = node.target.radius.powi(2);
        let halves = (node.children > 0).then(|| best[node.children].0 + best[node.children + 1].0);
        best[i] = halves.filter(|h| *h < worth * whole).map_or((whole, false), |h| (h, true));
    }
    let (mut chosen, mut waiting) = (Vec::new(), vec![0]);
    while let Some(i) = waiting.pop() {
        match best[i].1 {
            true => waiting.extend([nodes[i].children, nodes[i].children + 1]),
            false => chosen.push(nodes[i].target),
        }
    }
    chosen
}

/// Divides parts by the middle of the longest side of the box round their middles; where the second half begins. `None` if there is but one place.
fn divided(parts: &mut [Part]) -> Option<usize> {
    let middle = |p: &Part| 0.5 * (p.lo + p.hi);
    let first = middle(parts.first()?);
    let (lo, hi) = parts.iter().map(middle).fold((first, first), |(lo, hi), m| (lo.min(m), hi.max(m)));
    let size = hi - lo;
    let axis = (1..3).fold(0, |best, k| if size[k] > size[best] { k } else { best });
    let at = 0.5 * (lo[axis] + hi[axis]);
    let mut place = 0;
    for i in 0..parts.len() {
        if middle(&parts[i])[axis] < at {
            parts.swap(i, place);
            place += 1;
        }
    }
    (place > 0 && place < parts.len()).then_some(place)
}

impl Target {
    /// Whether the line through `o` along the unit vector `d` meets the sphere.
    pub fn meets(&self, o: DVec3, d: DVec3) -> bool {
        let v = self.centre - o;
        (v - d * v.dot(d)).length_squared() <= self.radius * self.radius
    }
}
