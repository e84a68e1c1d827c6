//! Patterns for the names in a foreign file.

use super::ForeignGroup;

/// Which of its names a group is known by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// The name of the node or group.
    Node,
    /// The name of the mesh or object.
    Mesh,
    /// The names of the nodes from the root, joined by `/`.
    Path,
    /// The name of the material.
    Material,
}

/// One condition: a name that fits, with `*` for any text and `?` for any character.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Term {
    /// The name that must fit; `None`: the node's, the mesh's or the material's.
    pub field: Option<Field>,
    /// The name, with `*` and `?`.
    pub glob: String,
}

/// Conditions that must all hold, as in `material:Glass + node:Door_*`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    /// As it was written.
    pub text: String,
    /// At least one.
    pub terms: Vec<Term>,
}

/// A pattern that is none.
#[derive(Debug, thiserror::Error)]
#[error("the pattern `{0}` has an empty term")]
pub struct PatternError(pub String);

/// How closely a pattern fits; the closest one decides.
///
/// More terms before fewer, then a node's name before a mesh's before a path before a material's, then exact names
/// before those with `*`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Closeness {
    terms: usize,
    fields: u32,
    is_exact: bool,
}

impl Pattern {
    /// `[node:|mesh:|path:|material:]NAME`, several joined by ` + `; a name with `/` is a path's.
    pub fn parse(text: &str) -> Result<Self, PatternError> {
        let fields = [
            ("node:", Field::Node),
            ("mesh:", Field::Mesh),
            ("path:", Field::Path),
            ("material:", Field::Material),
        ];
        let term = |term: &str| {
            let term = term.trim();
            let tagged =
                fields.iter().find_map(|(tag, field)| Some((*field, term.strip_prefix(tag)?)));
            let (field, glob) = match tagged {
                Some((field, glob)) => (Some(field), glob.trim()),
                None if term.contains('/') => (Some(Field::Path), term),
                None => (None, term),
            };
            let empty = glob.is_empty() && tagged.is_none();
            (!empty).then(|| Term { field, glob: glob.to_owned() })
        };
        let terms: Option<Vec<Term>> = text.split(" + ").map(term).collect();
        let terms = terms.ok_or_else(|| PatternError(text.to_owned()))?;
        Ok(Self { text: text.to_owned(), terms })
    }

    /// Whether it names one name only, without `*` and `?`.
    pub fn is_exact(&self) -> bool {
        self.terms.iter().all(|term| !term.glob.contains(['*', '?']))
    }

    pub(super) fn closeness(&self, group: &ForeignGroup) -> Option<Closeness> {
        let fields = self.terms.iter().map(|term| term.weight(group)).sum::<Option<u32>>()?;
        Some(Closeness { terms: self.terms.len(), fields, is_exact: self.is_exact() })
    }
}

impl Term {
    fn weight(&self, group: &ForeignGroup) -> Option<u32> {
        let fields = match self.field {
            Some(field) => vec![field],
            None => vec![Field::Node, Field::Mesh, Field::Material],
        };
        fields.into_iter().find_map(|field| {
            let (name, weight) = match field {
                Field::Node => (&group.node, 4),
                Field::Mesh => (&group.mesh, 3),
                Field::Path => (&group.path, 2),
                Field::Material => (&group.material, 1),
            };
            fits(&self.glob, name).then_some(weight)
        })
    }
}

/// Whether a name fits a pattern with `*` and `?`; the time is at most the product of their lengths.
fn fits(glob: &str, name: &str) -> bool {
    let (glob, name): (Vec<char>, Vec<char>) = (glob.chars().collect(), name.chars().collect());
    let (mut g, mut n) = (0, 0);
    // Where the last `*` stands, and where the text it takes ends so far.
    let mut star: Option<(usize, usize)> = None;
    while n < name.len() {
        if glob.get(g) == Some(&'*') {
            star = Some((g, n));
            g += 1;
        } else if glob.get(g).is_some_and(|c| *c == '?' || *c == name[n]) {
            g += 1;
            n += 1;
        } else if let Some((at, taken)) = star {
            star = Some((at, taken + 1));
            g = at + 1;
            n = taken + 1;
        } else {
            return false;
        }
    }
    glob[g..].iter().all(|c| *c == '*')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_any_text() {
        for (glob, name, expected) in [
            ("Tire_*", "Tire_FL", true),
            ("Tire_*", "Tire_", true),
            ("*_FL", "Tire_FL_2", false),
            ("*Light*FL", "Light_Low_Beam_Lens_FL", true),
            ("Door_F?", "Door_FL", true),
            ("Door_F?", "Door_F", false),
            ("a*b*c", "aXbYbZc", true),
            ("", "", true),
            ("", "a", false),
            ("*", "", true),
        ] {
            assert_eq!(fits(glob, name), expected, "{glob} {name}");
        }
    }

    #[test]
    fn more_terms_and_nearer_names_and_exact_ones_come_first() {
        let group = ForeignGroup {
            path: "Root/Door_FL".to_owned(),
            node: "Door_FL".to_owned(),
            mesh: "Mesh.1".to_owned(),
            material: "Glass".to_owned(),
            ..ForeignGroup::default()
        };
        let order = ["Glass", "Root/*", "Mesh.1", "Door_*", "Door_FL", "Door_* + material:Glass"];
        let closeness = order.map(|text| Pattern::parse(text).unwrap().closeness(&group));
        assert!(closeness.iter().all(Option::is_some));
        assert!(closeness.is_sorted());
        assert_eq!(Pattern::parse("Door_FL + material:Paint").unwrap().closeness(&group), None);
        for text in ["", "a +  + b", " "] {
            assert!(Pattern::parse(text).is_err(), "{text:?}");
        }
    }
}
