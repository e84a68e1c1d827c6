//! Which models of a zoo are right for the name that a data set gives a vehicle's mesh.
//!
//! The paper's zoo holds the very meshes of its data, and a name is its own answer; so it is with `partpose synth`. For
//! a zoo of other models the choice is judged by what the names have in common, or as the user says.

use std::collections::BTreeMap;

use crate::vehicle::ModelZoo;

/// A data set's names with the names of the models that are right for them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ModelNames {
    /// What the user says; of a name that is listed nothing else is right.
    pub given: BTreeMap<String, Vec<String>>,
}

impl ModelNames {
    /// The right models of the zoo as indices, the first rule that gives any: those that are given; the model of the
    /// same name; the models whose body style's first word the name begins with, whatever the case (`Sedan4Door` is any
    /// `sedan`, `Hatchback` a `hatchback-3-door`). Empty where nobody knows.
    pub fn right(&self, name: &str, zoo: &ModelZoo) -> Vec<usize> {
        let those = |is_right: &dyn Fn(&str, &str) -> bool| -> Vec<usize> {
            let models = zoo.models.iter().enumerate();
            models
                .filter(|(_, model)| is_right(model.name(), model.body_style()))
                .map(|(index, _)| index)
                .collect()
        };
        if let Some(given) = self.given.get(name) {
            return those(&|model, _| given.iter().any(|given| given == model));
        }
        let same = those(&|model, _| model == name);
        if !same.is_empty() {
            return same;
        }
        let name = name.to_lowercase();
        those(&|_, style| {
            let word = style.split('-').next().unwrap_or_default().to_lowercase();
            !word.is_empty() && name.starts_with(&word)
        })
    }

    /// Names among those given that no model of the zoo has.
    pub fn unknown(&self, zoo: &ModelZoo) -> Vec<&str> {
        let models = self.given.values().flatten().map(String::as_str);
        models.filter(|name| zoo.get(name).is_none()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_is_its_own_answer_then_the_body_style_is() {
        let zoo = ModelZoo::embedded();
        let names = |names: &ModelNames, name: &str| -> Vec<String> {
            let right = names.right(name, &zoo);
            right.into_iter().map(|index| zoo.models[index].name().to_owned()).collect()
        };
        let first = zoo.models[3].name();
        assert_eq!(names(&ModelNames::default(), first), [first]);
        let sedans = names(&ModelNames::default(), "Sedan4Door");
        assert!(sedans.len() > 1 && sedans.len() < zoo.models.len(), "{sedans:?}");
        assert!(names(&ModelNames::default(), "Peugeot_207").is_empty());
        let given = BTreeMap::from([("Sedan4Door".to_owned(), vec![first.to_owned()])]);
        let given = ModelNames { given };
        assert_eq!(names(&given, "Sedan4Door"), [first]);
        assert!(given.unknown(&zoo).is_empty());
        let wrong = ModelNames { given: BTreeMap::from([("a".to_owned(), vec!["b".to_owned()])]) };
        assert_eq!(wrong.unknown(&zoo), ["b"]);
    }
}
