//! An interface whose nodes the bodies share.

/// Edges between bonded bodies and the elements on one of its sides.
#[derive(Debug, Clone)]
pub(crate) struct BondedInterface {
    /// Nodes from the axis outwards.
    pub(crate) nodes: Vec<usize>,
    pub(crate) edges: Vec<[usize; 3]>,
    /// Elements of one of the bodies that touch the interface.
    pub(crate) elements: Vec<usize>,
    /// −1 where that body is the lower one: it is pushed down. +1 for the upper one.
    pub(crate) sign: f64,
}

impl BondedInterface {
    pub(crate) fn new(
        edges: &[[usize; 3]],
        elements: &[[usize; 9]],
        is_inside: impl Fn(usize) -> bool,
        sign: f64,
    ) -> Self {
        let mut nodes: Vec<usize> = Vec::new();
        for &node in edges.iter().flatten() {
            if !nodes.contains(&node) {
                nodes.push(node);
            }
        }
        let touching = (0..elements.len()).filter(|&index| {
            is_inside(index) && elements[index].iter().any(|node| nodes.contains(node))
        });
        Self {
            edges: edges.to_vec(),
            sign,
            elements: touching.collect(),
            nodes,
        }
    }
}
