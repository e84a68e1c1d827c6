//! How a foreign model becomes ours: axes, unit, and which names are which parts.

use crate::geometry::{Extent, Vector3};
use crate::parts::PartClass;

use super::{Pattern, split};

/// A direction along an axis of a foreign file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis {
    /// 0: x, 1: y, 2: z.
    pub index: usize,
    /// Whether it is the direction of falling values.
    pub is_negative: bool,
}

impl Axis {
    /// `+x`, `-x` and so on; the `+` may be missing.
    pub fn parse(text: &str) -> Option<Self> {
        let name = text.strip_prefix(['+', '-']).unwrap_or(text);
        let index = ["x", "y", "z"].iter().position(|axis| axis.eq_ignore_ascii_case(name))?;
        Some(Self { index, is_negative: text.starts_with('-') })
    }

    /// The unit vector in the file's axes.
    pub fn to_vector(self) -> Vector3 {
        let mut vector = Vector3::zeros();
        vector[self.index] = if self.is_negative { -1.0 } else { 1.0 };
        vector
    }
}

/// What tells left from right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sides {
    /// The map; parts that lie on the other side are told.
    #[default]
    Names,
    /// Where faces lie, whatever side the map says.
    Geometry,
}

/// What becomes of the faces that a pattern names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// They get the part; of several parts the one of the side, and of the end, on which they lie.
    Parts(Vec<PartClass>),
    /// They are of several parts that no name tells apart, and are left for `zoo annotate`.
    Unlabeled,
    /// They are left out: the interior, for instance.
    Ignore,
}

/// Why a text names no parts.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TargetError {
    /// A name that no part has.
    #[error("`{name}` is no part; the nearest is `{nearest}`")]
    Unknown {
        /// The name.
        name: String,
        /// The name of a part that is spelt most alike.
        nearest: &'static str,
    },
    /// Parts that neither side nor end tells apart.
    #[error("`{0}` cannot be told apart by side and end")]
    Alike(String),
}

impl Target {
    /// A part, or several joined by `|`, such as `wheels_RL|wheels_RR`.
    pub fn parse(text: &str) -> Result<Self, TargetError> {
        let part = |name: &str| {
            let name = name.trim();
            PartClass::from_name(name).ok_or_else(|| TargetError::Unknown {
                name: name.chars().take(60).collect(),
                nearest: nearest_part(name),
            })
        };
        let parts: Vec<PartClass> = text.split('|').map(part).collect::<Result<_, _>>()?;
        if !split::can_tell_apart(&parts) {
            return Err(TargetError::Alike(text.to_owned()));
        }
        Ok(Self::Parts(parts))
    }
}

/// A pattern and what becomes of the faces it names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rule {
    /// The names.
    pub pattern: Pattern,
    /// What becomes of them.
    pub target: Target,
}

/// How a foreign model becomes ours.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportMap {
    /// The name that identifies the model in its zoo.
    pub name: String,
    /// The data set's kind of vehicle, such as `Car`.
    pub category: String,
    /// The body style, such as `sedan`.
    pub body_style: String,
    /// Metres in one unit of the file.
    pub scale: f64,
    /// Where the vehicle's front points in the file.
    pub forward: Axis,
    /// Where its roof points; right is `forward` times `up`, as in every right-handed file.
    pub up: Axis,
    /// Whether left and right are exchanged after turning: for files with left-handed axes.
    pub mirror: bool,
    /// What tells left from right.
    pub sides: Sides,
    /// The annotated cuboid; that of the mesh, if not given.
    pub extent: Option<Extent>,
    /// Whether the cuboid of the mesh includes the mirrors.
    pub mirrors_in_extent: bool,
    /// What becomes of which names; the closest pattern decides.
    pub rules: Vec<Rule>,
}

/// The part whose name is spelt most alike.
fn nearest_part(name: &str) -> &'static str {
    let distance = |part: &PartClass| edit_distance(part.name(), name);
    PartClass::ALL.iter().min_by_key(|part| distance(part)).map_or("", |part| part.name())
}

/// Levenshtein's distance, capitals and small letters being equal, of the first 60 characters.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.to_lowercase().chars().take(60).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (at, x) in a.to_lowercase().chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = at + 1;
        for (to, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[to + 1];
            row[to + 1] = replaced.min(diagonal + 1).min(row[to] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_part_is_told_with_the_nearest() {
        for (name, nearest) in
            [("wheel_FL", "wheels_FL"), ("Windshield_f", "windshield_F"), ("doors_LF", "doors_FL")]
        {
            let error = Target::parse(name).unwrap_err();
            assert_eq!(
                error.to_string(),
                format!("`{name}` is no part; the nearest is `{nearest}`")
            );
        }
    }

    #[test]
    fn several_parts_must_differ_by_side_or_end() {
        for text in ["wheels_FL", "wheels_RL|wheels_RR", "apron_F|apron_R", "mirror_L|mirror_R"] {
            assert!(Target::parse(text).is_ok(), "{text}");
        }
        assert!(Target::parse("wheels_FL|wheels_FR|wheels_RL|wheels_RR").is_ok());
        for text in ["wheels_FL|lights_FL", "side_L|hood", "wheels_FL|wheels_RR|wheels_RL"] {
            assert!(Target::parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn axes_are_read_with_and_without_sign() {
        assert_eq!(Axis::parse("-Y").unwrap().to_vector(), Vector3::new(0.0, -1.0, 0.0));
        assert_eq!(Axis::parse("z").unwrap().to_vector(), Vector3::new(0.0, 0.0, 1.0));
        assert!(["", "w", "--x", "+", "xy"].iter().all(|text| Axis::parse(text).is_none()));
    }
}
