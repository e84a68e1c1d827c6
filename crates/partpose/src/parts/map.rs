//! A value for some of the parts.

use super::PartClass;

/// At most one value for each part, iterated in the order of ids: the paper's O2D is a `PartMap<Point2>`.
#[derive(Clone, Debug, PartialEq)]
pub struct PartMap<T> {
    values: [Option<T>; PartClass::COUNT],
}

impl<T> Default for PartMap<T> {
    fn default() -> Self {
        Self { values: [const { None }; PartClass::COUNT] }
    }
}

impl<T> PartMap<T> {
    /// The value of a part.
    pub fn get(&self, class: PartClass) -> Option<&T> {
        self.values[class.index()].as_ref()
    }

    /// The value of a part, to change it.
    pub fn get_mut(&mut self, class: PartClass) -> Option<&mut T> {
        self.values[class.index()].as_mut()
    }

    /// Sets the value of a part and returns the one it had.
    pub fn insert(&mut self, class: PartClass, value: T) -> Option<T> {
        self.values[class.index()].replace(value)
    }

    /// Takes a part out.
    pub fn remove(&mut self, class: PartClass) -> Option<T> {
        self.values[class.index()].take()
    }

    /// Keeps the parts for which `keep` holds.
    pub fn retain(&mut self, mut keep: impl FnMut(PartClass, &T) -> bool) {
        for class in PartClass::ALL {
            if self.get(class).is_some_and(|value| !keep(class, value)) {
                self.remove(class);
            }
        }
    }

    /// The parts that have a value, with it.
    pub fn iter(&self) -> impl Iterator<Item = (PartClass, &T)> {
        PartClass::ALL.into_iter().zip(&self.values).filter_map(|(c, v)| Some((c, v.as_ref()?)))
    }

    /// How many parts have a value.
    pub fn len(&self) -> usize {
        self.values.iter().flatten().count()
    }

    /// Whether no part has a value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The parts that both maps hold, with both values.
    pub fn zip<'a, U>(
        &'a self,
        other: &'a PartMap<U>,
    ) -> impl Iterator<Item = (PartClass, &'a T, &'a U)> {
        self.iter().filter_map(|(class, value)| Some((class, value, other.get(class)?)))
    }

    /// The same parts with other values.
    pub fn map<U>(&self, mut change: impl FnMut(PartClass, &T) -> U) -> PartMap<U> {
        self.iter().map(|(class, value)| (class, change(class, value))).collect()
    }
}

impl<T> FromIterator<(PartClass, T)> for PartMap<T> {
    fn from_iter<I: IntoIterator<Item = (PartClass, T)>>(pairs: I) -> Self {
        let mut map = Self::default();
        for (class, value) in pairs {
            map.insert(class, value);
        }
        map
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zip_holds_what_both_hold_in_the_order_of_ids() {
        let a: PartMap<i32> = [(PartClass::Hood, 1), (PartClass::Roof, 2), (PartClass::Trunk, 3)]
            .into_iter()
            .collect();
        let b: PartMap<char> =
            [(PartClass::Trunk, 't'), (PartClass::Roof, 'r')].into_iter().collect();
        let both: Vec<_> = a.zip(&b).collect();
        assert_eq!(both, [(PartClass::Roof, &2, &'r'), (PartClass::Trunk, &3, &'t')]);
    }

    #[test]
    fn retain_drops_what_is_refused() {
        let mut map: PartMap<i32> =
            PartClass::ALL.into_iter().map(|class| (class, i32::from(class.id()))).collect();
        map.retain(|_, id| *id % 2 == 0);
        assert_eq!(map.len(), 14);
        assert_eq!(map.get(PartClass::LightFrontLeft), None);
    }
}
