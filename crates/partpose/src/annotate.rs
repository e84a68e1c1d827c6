//! Part labels for meshes without them, transferred from labelled models.
//!
//! A mesh whose parts are not separate (one "body" object, windows painted on) is laid over the labelled models that
//! resemble it most; each of its faces, cut small, takes the part that lies there. What is transferred is marked, with
//! a confidence per face.

mod align;
mod evaluate;
mod lattice;
mod merge;
mod outside;
mod profile;
mod shape;
mod smooth;
mod surface;
mod tree;
mod vote;

pub use evaluate::{Agreement, agreement, leave_style_out};

use crate::parts::PartClass;
use crate::vehicle::{Mesh, ModelError, ModelZoo, PartialModel, VehicleModel};

use align::Alignment;
use outside::Seen;
use shape::{Facets, GRAIN, Shape, name_at};
use surface::Surface;
use vote::Voter;

/// How labels are transferred.
#[derive(Clone, Debug, PartialEq)]
pub struct AnnotateOptions {
    /// Body style that the sources must have; if none is given, the most similar models are taken, those of the mesh's
    /// own style first.
    pub style: Option<String>,
    /// Parts that the vehicle lacks, such as the rear doors of a coupe. Those that all labelled models of its body
    /// style lack are added.
    pub without: Vec<PartClass>,
    /// How many of the sources vote.
    pub sources: usize,
    /// Keeps faces without a label that can be seen from nowhere, such as seats.
    pub keep_hidden: bool,
}

impl Default for AnnotateOptions {
    fn default() -> Self {
        Self { style: None, without: Vec::new(), sources: 5, keep_hidden: false }
    }
}

/// Why a mesh could not be annotated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnnotateError {
    /// No face, or none with an area.
    #[error("the mesh has no surface")]
    NoSurface,
    /// No source at all.
    #[error("there is no labelled model to transfer from")]
    NoSource,
    /// No source of the style.
    #[error("no labelled model has the body style `{style}`: there are `{}`", known.join("`, `"))]
    Style {
        /// The style that was asked for.
        style: String,
        /// The styles there are.
        known: Vec<String>,
    },
    /// The result is no model.
    #[error("the labelled mesh makes no model")]
    Model(#[from] ModelError),
}

/// What the user should look at.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum AnnotateWarning {
    /// Turned round, the mesh is more like the sources.
    Backwards {
        /// Distance from the nearest source as it stands, metres.
        distance: f64,
        /// Distance when turned by half a turn.
        turned: f64,
    },
    /// Wider than long.
    Sideways,
    /// No wheel touches the ground: axles are guessed.
    NoWheels,
    /// Little alike any source.
    Unlike {
        /// Distance from the nearest source, metres.
        distance: f64,
    },
}

/// A labelled model that took part.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceUse {
    /// Its name.
    pub name: String,
    /// Its body style.
    pub body_style: String,
    /// Mean distance between target and source after scaling, metres, with normals counted.
    pub distance: f64,
    /// The same after bending.
    pub residual: f64,
    /// Its share of the votes.
    pub weight: f64,
}

/// An annotated model and where its labels come from.
#[derive(Clone, Debug)]
pub struct Annotation {
    /// The model; faces are cut where seams run through them.
    pub model: VehicleModel,
    /// For each face of the model whether its part was transferred; the others had it before.
    pub transferred: Vec<bool>,
    /// For each face how sure its part is, 0 to 1; 1 for given ones.
    pub confidence: Vec<f32>,
    /// The sources, most important first.
    pub sources: Vec<SourceUse>,
    /// Area of faces that were left out because they can be seen from nowhere, square metres.
    pub hidden_area: f64,
    /// What the user should look at.
    pub warnings: Vec<AnnotateWarning>,
}

/// Labelled models, prepared once for any number of meshes.
#[derive(Clone, Debug)]
pub struct Sources {
    items: Vec<Source>,
}

#[derive(Clone, Debug)]
struct Source {
    model: VehicleModel,
    shape: Shape,
}

impl Sources {
    /// Prepares the models of a zoo; `progress` hears how many are done.
    pub fn new(zoo: &ModelZoo, progress: &mut dyn FnMut(usize)) -> Self {
        let mut items = Vec::new();
        for (i, model) in zoo.models.iter().enumerate() {
            progress(i);
            let mesh = model.mesh();
            let parts: Vec<_> = mesh.parts.iter().copied().map(Some).collect();
            let surface = Surface::welded(&mesh.vertices, &mesh.faces, &parts).refined(GRAIN);
            let facets = shape::facets(&surface, &mesh.vertices, &mesh.faces);
            if let Some(shape) = Shape::of(&facets) {
                items.push(Source { model: model.clone(), shape });
            }
        }
        progress(zoo.models.len());
        Self { items }
    }

    /// Those for which `keep` holds.
    #[must_use]
    pub fn retained(&self, keep: impl Fn(&VehicleModel) -> bool) -> Self {
        Self { items: self.items.iter().filter(|item| keep(&item.model)).cloned().collect() }
    }
}

/// Labels on the cut surface of a mesh.
struct Transfer {
    surface: Surface,
    seen: Vec<Seen>,
    parts: Vec<PartClass>,
    confidence: Vec<f32>,
    sources: Vec<SourceUse>,
    warnings: Vec<AnnotateWarning>,
}

/// Gives every face of a mesh a part: its own, or one transferred from the sources.
pub fn annotate(
    partial: &PartialModel,
    sources: &Sources,
    options: &AnnotateOptions,
) -> Result<Annotation, AnnotateError> {
    let transfer = transfer(partial, sources, options)?;
    let merged = merge::merged(partial, &transfer);
    let surface = &merged.surface;
    let mut mesh = Mesh { vertices: surface.vertices.clone(), ..Mesh::default() };
    let (mut transferred, mut confidence, mut hidden_area) = (Vec::new(), Vec::new(), 0.0);
    // Part by part, as files hold them: what is told of each face then fits the file too.
    let mut order: Vec<usize> = (0..surface.faces.len()).collect();
    order.sort_by_key(|i| merged.parts[*i].id());
    for i in order {
        let is_given = surface.parts[i].is_some();
        if !is_given && !options.keep_hidden && merged.hidden[i] {
            hidden_area += surface.area(i);
            continue;
        }
        mesh.faces.push(surface.faces[i]);
        mesh.parts.push(merged.parts[i]);
        transferred.push(!is_given);
        confidence.push(merged.confidence[i]);
    }
    let model = VehicleModel::new(
        &partial.name,
        &partial.category,
        &partial.body_style,
        partial.extent,
        mesh,
    )?;
    let Transfer { sources, warnings, .. } = transfer;
    Ok(Annotation { model, transferred, confidence, sources, hidden_area, warnings })
}

fn transfer(
    partial: &PartialModel,
    sources: &Sources,
    options: &AnnotateOptions,
) -> Result<Transfer, AnnotateError> {
    let surface = Surface::welded(&partial.vertices, &partial.faces, &partial.parts).refined(GRAIN);
    let facets = shape::facets(&surface, &partial.vertices, &partial.faces);
    let target = Shape::of(&facets).ok_or(AnnotateError::NoSurface)?;
    let chosen = choose(&target, partial, sources, options)?;
    let mut warnings = warnings(&target, &chosen);
    if !target.frame.has_axles {
        warnings.push(AnnotateWarning::NoWheels);
    }
    let mut voters: Vec<Voter> = Vec::new();
    for (source, _) in &chosen {
        let alignment = Alignment::new(&target, &source.shape);
        voters.push(Voter { shape: &source.shape, alignment, weight: 0.0 });
    }
    let best = voters.iter().map(|v| v.alignment.residual).fold(f64::INFINITY, f64::min);
    for voter in &mut voters {
        voter.weight = (best / voter.alignment.residual.max(1e-9)).powi(2);
    }
    for (voter, (source, _)) in voters.iter_mut().zip(&chosen) {
        if source.model.body_style() == partial.body_style {
            voter.weight *= OWN_STYLE;
        }
    }
    let total: f64 = voters.iter().map(|voter| voter.weight).sum();
    let mut uses: Vec<SourceUse> = chosen
        .iter()
        .zip(&voters)
        .map(|((source, distance), voter)| SourceUse {
            name: source.model.name().to_owned(),
            body_style: source.model.body_style().to_owned(),
            distance: *distance,
            residual: voter.alignment.residual,
            weight: voter.weight / total,
        })
        .collect();
    uses.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let without = lacking(partial, sources, options);
    let votes = vote::votes(&facets.spots, &voters, &without);
    let ballots: Vec<_> = votes.iter().map(|votes| votes.ballot).collect();
    let smoothed = smooth::smoothed(&surface, &facets.spots, &ballots);
    let (mut parts, mut confidence) = (Vec::new(), Vec::new());
    for i in 0..surface.faces.len() {
        if let Some(part) = surface.parts[i] {
            parts.push(part);
            confidence.push(1.0);
            continue;
        }
        let best = (0..PartClass::COUNT)
            .max_by(|a, b| smoothed[i][*a].total_cmp(&smoothed[i][*b]).then(b.cmp(a)))
            .unwrap_or(0);
        parts.push(name_at(PartClass::ALL[best], surface.center(i).x));
        let sight = if facets.seen[i] == Seen::Hidden { 0.3 } else { 1.0 };
        confidence.push(votes[i].ballot[best] * votes[i].fit.min(1.0) * sight);
    }
    let Facets { seen, .. } = facets;
    Ok(Transfer { surface, seen, parts, confidence, sources: uses, warnings })
}

/// How much more a source of the mesh's own body style counts: its seams are where no shape tells them.
const OWN_STYLE: f64 = 3.0;

/// The parts that a vehicle is not given: those it is said to lack, and those that its body style lacks.
fn lacking(partial: &PartialModel, sources: &Sources, options: &AnnotateOptions) -> Vec<PartClass> {
    let mut lacking = options.without.clone();
    let style = options.style.as_deref().unwrap_or(&partial.body_style);
    let alike: Vec<Vec<PartClass>> = sources
        .items
        .iter()
        .filter(|source| source.model.body_style() == style)
        .map(|source| source.model.missing_parts())
        .collect();
    if let Some((first, rest)) = alike.split_first() {
        lacking.extend(first.iter().filter(|part| rest.iter().all(|other| other.contains(part))));
    }
    lacking
}

/// The sources that are nearest, or those of the style, with their distances.
fn choose<'a>(
    target: &Shape,
    partial: &PartialModel,
    sources: &'a Sources,
    options: &AnnotateOptions,
) -> Result<Vec<(&'a Source, f64)>, AnnotateError> {
    if sources.items.is_empty() {
        return Err(AnnotateError::NoSource);
    }
    let fits = |source: &&Source| {
        options.style.as_ref().is_none_or(|style| source.model.body_style() == style)
    };
    let candidates = sources.items.iter().filter(fits);
    let mut chosen: Vec<(&Source, f64)> =
        candidates.map(|source| (source, align::distance(target, &source.shape))).collect();
    if chosen.is_empty() {
        let mut known: Vec<String> =
            sources.items.iter().map(|s| s.model.body_style().to_owned()).collect();
        known.sort();
        known.dedup();
        let style = options.style.clone().unwrap_or_default();
        return Err(AnnotateError::Style { style, known });
    }
    let is_other = |source: &Source| source.model.body_style() != partial.body_style;
    chosen.sort_by(|a, b| is_other(a.0).cmp(&is_other(b.0)).then(a.1.total_cmp(&b.1)));
    chosen.truncate(options.sources.max(1));
    Ok(chosen)
}

/// Mean distance above which a mesh is hardly like its nearest source, metres.
const UNLIKE: f64 = 0.2;

fn warnings(target: &Shape, chosen: &[(&Source, f64)]) -> Vec<AnnotateWarning> {
    let mut warnings = Vec::new();
    let distance = chosen.iter().map(|(_, distance)| *distance).fold(f64::INFINITY, f64::min);
    let back = align::turned(target);
    let turned = chosen.iter().map(|(source, _)| align::distance(&back, &source.shape));
    let turned = turned.fold(f64::INFINITY, f64::min);
    if turned < 0.9 * distance {
        warnings.push(AnnotateWarning::Backwards { distance, turned });
    }
    let [rear, _, _, front] = target.frame.stations;
    if front - rear < 2.0 * target.frame.half_width {
        warnings.push(AnnotateWarning::Sideways);
    }
    if distance > UNLIKE {
        warnings.push(AnnotateWarning::Unlike { distance });
    }
    warnings
}
