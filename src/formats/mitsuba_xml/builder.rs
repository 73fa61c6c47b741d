//! The scene under construction: tables of textures, materials and shapes, each object built once, and the list of
//! files that are read when the rest is known to be right.

use super::files;
use super::props::Props;
use super::report::{Checked, Loc, Report, Reported};
use super::tree::{ObjectId, Tree};
use crate::formats::assets::{self, MeshKind};
use crate::math::Rgb;
use crate::scene::description::{GeometryDesc, ImageId, LightDesc, MaterialId, ShapeDesc, TextureId};
use crate::scene::material::Material;
use crate::scene::mesh::MeshData;
use crate::scene::texture::{Bitmap, Texture};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Deepest nesting of materials and textures through references.
const DEPTH_LIMIT: usize = 64;

/// State of an object that others may share.
#[derive(Clone, Copy, Default)]
enum Slot {
    #[default]
    Untouched,
    /// Being built: meeting it again is a cycle.
    Open,
    Failed,
    Ready(u32),
}

/// A mesh shape that waits for its file.
pub struct PendingMesh {
    /// Index of the shape.
    pub shape: usize,
    /// Index of the file.
    pub file: usize,
    /// Facets asked for.
    pub face_normals: bool,
    /// Crease angle, radians.
    pub max_smooth_angle: Option<f32>,
}

/// See the module's text.
pub struct Builder<'t> {
    /// The file.
    pub tree: &'t Tree,
    /// Messages.
    pub report: &'t Report,
    /// Textures.
    pub textures: Vec<Texture>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Shapes; meshes are empty until their files are read.
    pub shapes: Vec<ShapeDesc>,
    /// Lights that are no surface.
    pub lights: Vec<LightDesc>,
    /// Shapes that wait for their files.
    pub pending: Vec<PendingMesh>,
    slots: Vec<Slot>,
    depth: usize,
    defaults: BTreeMap<bool, MaterialId>,
    /// Mesh files, each kind of reading once.
    pub meshes: Vec<(PathBuf, MeshKind, Loc)>,
    images: Vec<(PathBuf, bool, Loc)>,
    /// Places of files in the two lists above.
    mesh_index: BTreeMap<(PathBuf, MeshKind), usize>,
    image_index: BTreeMap<(PathBuf, bool), usize>,
}

impl<'t> Builder<'t> {
    /// Nothing built yet.
    pub fn new(tree: &'t Tree, report: &'t Report) -> Self {
        Self {
            tree,
            report,
            textures: Vec::new(),
            materials: Vec::new(),
            shapes: Vec::new(),
            lights: Vec::new(),
            pending: Vec::new(),
            slots: vec![Slot::default(); tree.objects.len()],
            depth: 0,
            defaults: BTreeMap::new(),
            meshes: Vec::new(),
            images: Vec::new(),
            mesh_index: BTreeMap::new(),
            image_index: BTreeMap::new(),
        }
    }

    /// Access to the properties of an object.
    pub fn props(&self, id: ObjectId) -> Props<'t> {
        Props::new(self.tree, id, self.report)
    }

    /// Builds an object once; a second call gives the first result. Cycles are errors.
    fn shared(&mut self, id: ObjectId, loc: Loc, build: impl FnOnce(&mut Self) -> Checked<u32>) -> Checked<u32> {
        match self.slots[id] {
            Slot::Ready(index) => return Ok(index),
            Slot::Failed => return Err(Reported),
            Slot::Open => return Err(self.report.error(loc, "the object contains itself")),
            Slot::Untouched => {}
        }
        if self.depth >= DEPTH_LIMIT {
            return Err(self.report.error(loc, format!("objects are nested more than {DEPTH_LIMIT} deep")));
        }
        self.slots[id] = Slot::Open;
        self.depth += 1;
        let result = build(self);
        self.depth -= 1;
        self.slots[id] = result.map_or(Slot::Failed, Slot::Ready);
        result
    }

    /// Material of a `<bsdf>` object.
    pub fn material(&mut self, id: ObjectId, loc: Loc) -> Checked<MaterialId> {
        self.shared(id, loc, |b| {
            let material = super::bsdf::read(b, id)?;
            Ok(b.add_material(material))
        })
    }

    /// Texture of a `<texture>` object.
    pub fn texture(&mut self, id: ObjectId, loc: Loc) -> Checked<TextureId> {
        self.shared(id, loc, |b| {
            let texture = super::texture::read(b, id)?;
            Ok(b.add_texture(texture))
        })
    }

    /// Appends a material.
    pub fn add_material(&mut self, material: Material) -> MaterialId {
        self.materials.push(material);
        (self.materials.len() - 1) as MaterialId
    }

    /// Appends a texture.
    pub fn add_texture(&mut self, texture: Texture) -> TextureId {
        self.textures.push(texture);
        (self.textures.len() - 1) as TextureId
    }

    /// Material of shapes that name none: grey, or black for lamps.
    pub fn default_material(&mut self, lamp: bool) -> MaterialId {
        if let Some(&id) = self.defaults.get(&lamp) {
            return id;
        }
        let id = self.add_material(super::bsdf::grey(if lamp { 0.0 } else { 0.5 }));
        self.defaults.insert(lamp, id);
        id
    }

    /// The file that the property `filename` names.
    fn file(&self, props: &Props, what: &str) -> Checked<(PathBuf, Loc)> {
        let Some(name) = props.string("filename")? else {
            let message = format!("{} needs the property \"filename\"", props.title());
            return Err(self.report.error(props.object.loc, message));
        };
        let loc = props.loc("filename");
        let mut folders = vec![files::folder_of(&self.report.path(loc.source))];
        folders.extend(self.tree.folders.iter().filter(|f| **f != folders[0]).cloned().collect::<Vec<_>>());
        Ok((files::find(name, &folders, loc, what, self.report)?, loc))
    }

    /// Asks for the picture that the property `filename` names.
    pub fn image(&mut self, props: &Props, srgb: bool) -> Checked<ImageId> {
        let (path, loc) = self.file(props, "picture")?;
        let images = &mut self.images;
        let index = *self.image_index.entry((path.clone(), srgb)).or_insert_with(|| {
            images.push((path, srgb, loc));
            images.len() - 1
        });
        Ok(index as ImageId)
    }

    /// Whether 8-bit values of a picture are decoded to linear.
    pub fn decodes_srgb(&self, image: ImageId) -> bool {
        self.images[image as usize].1
    }

    /// Asks for the mesh that the property `filename` names; gives its place among the files.
    pub fn mesh(&mut self, props: &Props, kind: MeshKind) -> Checked<usize> {
        let (path, loc) = self.file(props, "mesh")?;
        let meshes = &mut self.meshes;
        Ok(*self.mesh_index.entry((path.clone(), kind)).or_insert_with(|| {
            meshes.push((path, kind, loc));
            meshes.len() - 1
        }))
    }

    /// Reads all files, in parallel, and fills the mesh shapes.
    pub fn read_files(&mut self) -> Checked<Vec<Bitmap>> {
        let (meshes, images) = rayon::join(
            || self.meshes.par_iter().map(|(path, kind, _)| assets::read_mesh(path, *kind)).collect::<Vec<_>>(),
            || self.images.par_iter().map(|(path, srgb, _)| assets::read_bitmap(path, *srgb)).collect::<Vec<_>>(),
        );
        let report = self.report;
        let (mesh_files, image_files) = (&self.meshes, &self.images);
        let fail = |path: &PathBuf, loc: Loc, error: String| {
            let name = path.display().to_string();
            let text = if error.contains(&name) { error } else { format!("{name}: {error}") };
            report.error(loc, text)
        };
        let meshes: Vec<Checked<MeshData>> = meshes
            .into_iter()
            .zip(mesh_files)
            .map(|(mesh, (path, _, loc))| mesh.map_err(|e| fail(path, *loc, e)))
            .collect();
        let images: Vec<Checked<Bitmap>> = images
            .into_iter()
            .zip(image_files)
            .map(|(image, (path, _, loc))| {
                let mut image = image.map_err(|e| fail(path, *loc, e))?;
                // One such value would spoil the sums of a whole environment map.
                let broken = blacken(&mut image);
                if broken > 0 {
                    let message = format!("{}: {broken} pixels are not finite; taken as black", path.display());
                    report.warn(*loc, message);
                }
                Ok(image)
            })
            .collect();
        let mut meshes = meshes.into_iter().collect::<Checked<Vec<_>>>()?;
        let images = images.into_iter().collect::<Checked<Vec<_>>>()?;
        // The last shape that shows a mesh takes it, the others get copies.
        let mut users = vec![0usize; meshes.len()];
        self.pending.iter().for_each(|p| users[p.file] += 1);
        for pending in &self.pending {
            users[pending.file] -= 1;
            let mesh = &mut meshes[pending.file];
            let mut mesh = if users[pending.file] == 0 { std::mem::take(mesh) } else { mesh.clone() };
            // The file may ask for facets by itself (`serialized` does).
            mesh.face_normals |= pending.face_normals;
            mesh.max_smooth_angle = pending.max_smooth_angle;
            self.shapes[pending.shape].geometry = GeometryDesc::Mesh(mesh);
        }
        Ok(images)
    }
}

/// Makes pixels black that are not finite, and counts them.
fn blacken(image: &mut Bitmap) -> usize {
    let broken = image.pixels.iter_mut().filter(|p| !p.is_finite());
    broken.map(|p| *p = Rgb::ZERO).count()
}
