//! Checks of a scene that need rays: lamps that light nothing.

use crate::accel::{Accel, Ray};
use crate::math::sampler::hash;
use crate::math::warp::sample_cosine_hemisphere;
use crate::math::{Frame, Sampler};
use crate::scene::{Scene, Shape};

/// Rays per lamp.
const RAYS: u64 = 64;
/// Most lamps examined: the check must stay cheap beside a render.
const MOST_LAMPS: usize = 256;
/// A lamp whose every ray ends within this share of its own size faces what it is mounted on.
const NEAR: f32 = 0.05;

/// A warning for each area light whose light goes nowhere: into empty space, or into the surface it is mounted on.
pub fn idle_lamps(scene: &Scene, accel: &Accel) -> Vec<String> {
    let lamps = scene.shapes.iter().enumerate().filter(|(_, s)| s.emission.is_some());
    lamps.take(MOST_LAMPS).filter_map(|(i, s)| idle(accel, i as u32, s)).collect()
}

fn idle(accel: &Accel, index: u32, shape: &Shape) -> Option<String> {
    let (lo, hi) = shape.bounds();
    let size = (hi - lo).length();
    let prims = shape.primitive_count() as u64;
    let (mut farthest, mut hits) = (0f32, 0);
    let mut normal = None;
    for i in 0..RAYS {
        let mut rng = Sampler::new(0, u64::from(index), i);
        let (at, _) = shape.sample_area(index, (hash(u64::from(index), i) % prims.max(1)) as u32, rng.next_2d());
        let d = Frame::from_normal(at.n_geo).to_world(sample_cosine_hemisphere(rng.next_2d()));
        normal = normal.or(Some(at.n_geo));
        let ray = Ray::leaving(&at, d);
        if let Some(hit) = accel.closest(&ray) {
            hits += 1;
            farthest = farthest.max(hit.t);
        }
    }
    let n = normal?;
    let reason = match hits {
        0 => "away from everything",
        n if n == RAYS && farthest < NEAR * size => "into a surface right in front of it",
        _ => return None,
    };
    let name = &shape.name;
    Some(format!("lamp \"{name}\" lights nothing: its normal points to ({:.2}, {:.2}, {:.2}), {reason}", n.x, n.y, n.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::{LoadOptions, mitsuba_xml::load_text};
    use std::path::Path;

    fn said(angle: f64, lamp_height: f64) -> Vec<String> {
        let text = format!(
            r#"<scene version="3.0.0"><sensor type="perspective"/>
            <shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate x="1" angle="-90"/></transform></shape>
            <shape type="rectangle" id="lamp"><transform name="to_world">
                <rotate x="1" angle="{angle}"/><translate y="{lamp_height}"/></transform>
                <emitter type="area"/></shape></scene>"#
        );
        let loaded = load_text(Path::new("lamp.xml"), &text, &LoadOptions::default()).expect("valid");
        let scene = Scene::new(loaded.description).expect("valid");
        idle_lamps(&scene, &Accel::new(&scene.shapes))
    }

    #[test]
    fn lamps_that_light_nothing_are_named() {
        assert!(said(90.0, 2.0).is_empty(), "facing the floor");
        let up = said(-90.0, 2.0);
        assert!(up.len() == 1 && up[0].contains("\"lamp\"") && up[0].contains("away from everything"), "{up:?}");
        let mounted = said(90.0, 0.001);
        assert!(mounted.len() == 1 && mounted[0].contains("right in front"), "{mounted:?}");
    }
}
