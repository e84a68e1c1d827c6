//! An ONNX graph node by node (ONNX, *Open Neural Network Exchange Specification*, intermediate representation 8).
//!
//! Numbers of fields are those of `onnx.proto3`.

use super::proto::Message;

/// Version of the file format.
const IR_VERSION: i64 = 8;
/// Operator set; 16 is the first in which `RoiAlign` knows half pixels.
const OPERATORS: i64 = 16;
/// Numbers of the types of tensors.
const FLOAT: i64 = 1;
const INT64: i64 = 7;

/// A graph that is being written.
#[derive(Clone, Debug)]
pub struct Graph {
    name: String,
    nodes: Message,
    initializers: Message,
    inputs: Message,
    outputs: Message,
    /// Names that were given.
    count: usize,
}

/// A tensor of a graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Value(String);

/// An attribute of a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Attribute<'a> {
    /// A whole number.
    Int(i64),
    /// A number.
    Float(f32),
    /// Whole numbers.
    Ints(&'a [i64]),
    /// A word.
    Text(&'a str),
}

/// What a tensor holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// 32-bit floats.
    Float,
    /// 64-bit integers.
    Int,
}

/// The length of an axis of an input or output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis<'a> {
    /// Always the same.
    Fixed(usize),
    /// Known when the model runs; equal names are equal lengths.
    Free(&'a str),
}

impl Value {
    /// An optional input that is not there.
    pub fn none() -> Self {
        Self(String::new())
    }
}

impl Graph {
    /// An empty graph.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            nodes: Message::default(),
            initializers: Message::default(),
            inputs: Message::default(),
            outputs: Message::default(),
            count: 0,
        }
    }

    /// An input of the model.
    pub fn input(&mut self, name: &str, element: Element, axes: &[Axis<'_>]) -> Value {
        self.inputs.message(11, &described(name, element, axes));
        Value(name.to_owned())
    }

    /// Makes a value an output of the model.
    pub fn output(&mut self, value: &Value, name: &str, element: Element, axes: &[Axis<'_>]) {
        self.add("Identity", &[value], &[], &[name.to_owned()]);
        self.outputs.message(12, &described(name, element, axes));
    }

    /// A constant of floats.
    ///
    /// # Panics
    ///
    /// If the shape does not hold as many values: a bug of the caller.
    pub fn floats(&mut self, values: &[f32], shape: &[usize]) -> Value {
        assert_eq!(values.len(), shape.iter().product::<usize>(), "{shape:?}");
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.constant(FLOAT, &bytes, shape)
    }

    /// A constant of whole numbers along one axis.
    pub fn ints(&mut self, values: &[i64]) -> Value {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.constant(INT64, &bytes, &[values.len()])
    }

    /// A constant whole number without axes.
    pub fn int(&mut self, value: i64) -> Value {
        self.constant(INT64, &value.to_le_bytes(), &[])
    }

    /// A constant float without axes.
    pub fn float(&mut self, value: f32) -> Value {
        self.constant(FLOAT, &value.to_le_bytes(), &[])
    }

    /// The only, or the first, output of a new node.
    pub fn node(
        &mut self,
        operator: &str,
        inputs: &[&Value],
        attributes: &[(&str, Attribute<'_>)],
    ) -> Value {
        let name = self.name();
        self.add(operator, inputs, attributes, std::slice::from_ref(&name));
        Value(name)
    }

    /// Both outputs of a new node.
    pub fn node_with_two(
        &mut self,
        operator: &str,
        inputs: &[&Value],
        attributes: &[(&str, Attribute<'_>)],
    ) -> [Value; 2] {
        let names = [self.name(), self.name()];
        self.add(operator, inputs, attributes, &names);
        names.map(Value)
    }

    /// The bytes of the model; `metadata` are pairs of key and text.
    pub fn finish(self, metadata: &[(&str, &str)]) -> Vec<u8> {
        let mut graph = self.nodes;
        graph.text(2, &self.name);
        graph.0.extend(self.initializers.0);
        graph.0.extend(self.inputs.0);
        graph.0.extend(self.outputs.0);
        let mut model = Message::default();
        model.int(1, IR_VERSION);
        model.text(2, "partpose");
        model.text(3, env!("CARGO_PKG_VERSION"));
        model.message(7, &graph);
        let mut operators = Message::default();
        operators.int(2, OPERATORS);
        model.message(8, &operators);
        for (key, text) in metadata {
            let mut pair = Message::default();
            pair.text(1, key);
            pair.text(2, text);
            model.message(14, &pair);
        }
        model.0
    }

    fn name(&mut self) -> String {
        self.count += 1;
        format!("v{}", self.count)
    }

    fn constant(&mut self, kind: i64, bytes: &[u8], shape: &[usize]) -> Value {
        let name = self.name();
        let mut tensor = Message::default();
        for length in shape {
            tensor.int(1, *length as i64);
        }
        tensor.int(2, kind);
        tensor.text(8, &name);
        tensor.bytes(9, bytes);
        self.initializers.message(5, &tensor);
        Value(name)
    }

    fn add(
        &mut self,
        operator: &str,
        inputs: &[&Value],
        attributes: &[(&str, Attribute<'_>)],
        outputs: &[String],
    ) {
        let mut node = Message::default();
        for input in inputs {
            node.text(1, &input.0);
        }
        for output in outputs {
            node.text(2, output);
        }
        node.text(3, &format!("{operator}-{}", outputs[0]));
        node.text(4, operator);
        for (name, attribute) in attributes {
            node.message(5, &attribute.encode(name));
        }
        self.nodes.message(1, &node);
    }
}

impl Attribute<'_> {
    fn encode(&self, name: &str) -> Message {
        let mut message = Message::default();
        message.text(1, name);
        let kind = match self {
            Self::Float(value) => {
                message.float(2, *value);
                1
            }
            Self::Int(value) => {
                message.int(3, *value);
                2
            }
            Self::Text(text) => {
                message.text(4, text);
                3
            }
            Self::Ints(values) => {
                values.iter().for_each(|value| message.int(8, *value));
                7
            }
        };
        message.int(20, kind);
        message
    }
}

/// Name, type and shape of an input or output.
fn described(name: &str, element: Element, axes: &[Axis<'_>]) -> Message {
    let mut shape = Message::default();
    for axis in axes {
        let mut dimension = Message::default();
        match axis {
            Axis::Fixed(length) => dimension.int(1, *length as i64),
            Axis::Free(name) => dimension.text(2, name),
        }
        shape.message(1, &dimension);
    }
    let mut tensor = Message::default();
    tensor.int(1, if element == Element::Float { FLOAT } else { INT64 });
    tensor.message(2, &shape);
    let mut kind = Message::default();
    kind.message(1, &tensor);
    let mut value = Message::default();
    value.text(1, name);
    value.message(2, &kind);
    value
}
