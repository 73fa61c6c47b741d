//! A scene as a file describes it: plain data with defaults applied, names resolved to indices and files read,
//! but nothing derived yet. Every reader of `formats` produces this, and [`super::Scene`] is built from it.

use super::material::Material;
use super::mesh::MeshData;
use super::texture::{Bitmap, Color, Texture};
use crate::math::filter::PixelFilter;
use crate::math::{DMat4, DVec3, Rgb};

/// Index into [`Description::materials`].
pub type MaterialId = u32;
/// Index into [`Description::textures`].
pub type TextureId = u32;
/// Index into [`Description::images`].
pub type ImageId = u32;

/// Everything a scene file says. Angles are radians, lengths and radiances in the file's own units.
#[derive(Clone, Debug)]
pub struct Description {
    /// The camera.
    pub camera: CameraDesc,
    /// Image size, crop window and pixel filter.
    pub film: FilmDesc,
    /// The integrator the file names and its parameters.
    pub integrator: IntegratorDesc,
    /// Samples per pixel the file asks for, `None` where it says nothing.
    pub sample_count: Option<u32>,
    /// Seed the file asks for.
    pub seed: u64,
    /// Bitmaps, in linear RGB.
    pub images: Vec<Bitmap>,
    /// Textures; may refer to `images` and to one another, without cycles.
    pub textures: Vec<Texture>,
    /// Materials; nested ones refer to others by index, without cycles.
    pub materials: Vec<Material>,
    /// Shapes in the order of the file.
    pub shapes: Vec<ShapeDesc>,
    /// Lights that are no surface.
    pub lights: Vec<LightDesc>,
}

impl Description {
    /// A scene of nothing: a pinhole camera with a horizontal field of view of one radian, `width` x `height` pixels, box filter.
    pub fn empty(to_world: DMat4, width: u32, height: u32) -> Self {
        Description {
            camera: CameraDesc {
                to_world,
                projection: Projection::Perspective {
                    x_fov: 1.0,
                    principal_point_offset: [0.0; 2],
                    aperture_radius: 0.0,
                    focus_distance: 1.0,
                },
                near_clip: 1e-4,
                far_clip: 1e6,
            },
            film: FilmDesc { width, height, crop: [0, 0, width, height], filter: PixelFilter::Box { radius: 0.5 } },
            integrator: IntegratorDesc::default(),
            sample_count: None,
            seed: 0,
            images: vec![],
            textures: vec![],
            materials: vec![],
            shapes: vec![],
            lights: vec![],
        }
    }
}

/// A camera. Camera space: +z looks into the scene, +y is up, +x points to the *left* of the picture.
#[derive(Clone, Debug)]
pub struct CameraDesc {
    /// Camera space to world; rigid, possibly mirrored (orthographic: x and y scale are half the film's size).
    pub to_world: DMat4,
    /// The projection.
    pub projection: Projection,
    /// Depth along +z at which rays start.
    pub near_clip: f64,
    /// Depth along +z at which rays end.
    pub far_clip: f64,
}

/// How film positions turn into rays.
#[derive(Clone, Debug)]
pub enum Projection {
    /// Pinhole, or thin lens when `aperture_radius` is above zero.
    Perspective {
        /// Horizontal field of view of the full film (not of the crop window), radians.
        x_fov: f64,
        /// Shift of the principal point in units of the film's width and height.
        principal_point_offset: [f64; 2],
        /// Radius of the lens; 0 is a pinhole.
        aperture_radius: f64,
        /// Depth along +z of the plane in focus (used with a lens only).
        focus_distance: f64,
    },
    /// Parallel projection of the square `[-1,1]` (x by width; y scaled by the aspect ratio) along +z.
    Orthographic,
}

/// The image: size, crop and reconstruction filter.
#[derive(Clone, Debug)]
pub struct FilmDesc {
    /// Width of the full image, pixels.
    pub width: u32,
    /// Height of the full image, pixels.
    pub height: u32,
    /// Crop window (x, y, width, height) in pixels; the whole image where nothing is said.
    pub crop: [u32; 4],
    /// Reconstruction filter.
    pub filter: PixelFilter,
}

/// What the file says about light transport. `None` means: nothing said.
#[derive(Clone, Debug, Default)]
pub struct IntegratorDesc {
    /// Plugin name as in the file (`path`, `sppm`, ...); empty if the file names none.
    pub name: String,
    /// Longest path, counted as Mitsuba does: 1 = emitters seen directly, 2 = direct light; `None` = unbounded.
    pub max_depth: Option<u32>,
    /// Depth at which Russian roulette starts.
    pub rr_depth: Option<u32>,
    /// Emitters are invisible to camera rays.
    pub hide_emitters: bool,
    /// Wall clock limit, seconds.
    pub timeout: Option<f64>,
    /// Parameters of photon integrators (`photonmapper`, `ppm`, `sppm`).
    pub photon: PhotonDesc,
}

/// Parameters of Mitsuba 0.6's photon integrators, as far as the file sets them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhotonDesc {
    /// Photons per pass (`photonCount`), or of the global map (`globalPhotons`).
    pub photon_count: Option<u64>,
    /// Photons of the caustic map (`causticPhotons`).
    pub caustic_photons: Option<u64>,
    /// First radius (`initialRadius`; 0 = automatic), world units.
    pub initial_radius: Option<f64>,
    /// Look-up radius of the global map relative to the scene's size (`globalLookupRadius`).
    pub global_lookup_radius: Option<f64>,
    /// Look-up radius of the caustic map relative to the scene's size (`causticLookupRadius`).
    pub caustic_lookup_radius: Option<f64>,
    /// Photons per look-up (`lookupSize`).
    pub lookup_size: Option<u32>,
    /// Radius reduction (`alpha`).
    pub alpha: Option<f64>,
    /// Passes (`maxPasses`).
    pub max_passes: Option<u32>,
    /// Write an image every so many passes (`stepSnapshot`).
    pub step_snapshot: Option<u32>,
    /// Light samples per gather point (`directSamples`).
    pub direct_samples: Option<u32>,
    /// Longest specular chain (`maxSpecularDepth`).
    pub max_specular_depth: Option<u32>,
}

/// A shape with its material and, if it is a lamp, its emission.
#[derive(Clone, Debug)]
pub struct ShapeDesc {
    /// Id in the file, or a made-up name such as `shape 3 (obj)`; for messages and `info`.
    pub name: String,
    /// Object-space geometry.
    pub geometry: GeometryDesc,
    /// Object space to world.
    pub to_world: DMat4,
    /// Turns the normal side around.
    pub flip_normals: bool,
    /// Material.
    pub material: MaterialId,
    /// Emitted radiance on the normal side, if the shape is an area light.
    pub emission: Option<Color>,
}

/// Geometry in object space.
#[derive(Clone, Debug)]
pub enum GeometryDesc {
    /// The square `[-1,1]^2` at z = 0, normal +z, uv (0,0) at (-1,-1).
    Rectangle,
    /// The cube `[-1,1]^3`, uv `[0,1]^2` on each face.
    Cube,
    /// A sphere; uv pole +z, u = 0 at +x.
    Sphere {
        /// Centre.
        center: DVec3,
        /// Radius.
        radius: f64,
    },
    /// The unit disk at z = 0, normal +z; u is the radius, v the angle over 2 pi.
    Disk,
    /// An open cylinder, normals outwards.
    Cylinder {
        /// Centre of the first rim.
        p0: DVec3,
        /// Centre of the second rim.
        p1: DVec3,
        /// Radius.
        radius: f64,
    },
    /// Triangles.
    Mesh(MeshData),
}

/// A light that is no surface.
#[derive(Clone, Debug)]
pub enum LightDesc {
    /// Isotropic point light.
    Point {
        /// Position in the world.
        position: DVec3,
        /// Radiant intensity, W/sr.
        intensity: Rgb,
    },
    /// Spot light along +z of its own space, intensity falling linearly in the angle from `beam_width` to `cutoff_angle`.
    Spot {
        /// Light space to world.
        to_world: DMat4,
        /// Radiant intensity at the centre, W/sr.
        intensity: Rgb,
        /// Half angle beyond which nothing is emitted, radians.
        cutoff_angle: f64,
        /// Half angle of full intensity, radians.
        beam_width: f64,
        /// Factor over the cone; the square of tangent `cutoff_angle` maps to uv.
        texture: Option<TextureId>,
    },
    /// Parallel light.
    Directional {
        /// Direction in which the light travels; any length above 0.
        direction: DVec3,
        /// Irradiance on a plane facing the light.
        irradiance: Rgb,
    },
    /// The same radiance from everywhere at infinity.
    Constant {
        /// Radiance.
        radiance: Rgb,
    },
    /// Latitude-longitude map at infinity, +y up: u = atan2(x, -z) / 2 pi, v = acos(y) / pi.
    EnvMap {
        /// The map, linear radiance.
        image: ImageId,
        /// Factor on the map.
        scale: Rgb,
        /// Map space to world (rotation).
        to_world: DMat4,
    },
}
