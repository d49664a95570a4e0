//! Connected parts of the mask (four neighbours) by union–find.

use super::system::System;
use crate::Scalar;

const NONE: u32 = u32::MAX;

/// Labels of the nodes of a grid.
#[derive(Debug, Default)]
pub(super) struct Components {
    /// Parent of a node while uniting, then its label.
    parent: Vec<u32>,
    count: usize,
}

impl Components {
    /// Labels the parts in reading order of their first pixels.
    pub(super) fn label<T: Scalar>(&mut self, system: &System<T>) {
        let length = system.inside.len();
        self.parent.clear();
        self.parent
            .extend((0..length as u32).map(|i| if system.inside[i as usize] { i } else { NONE }));
        for i in 0..length {
            if system.inside[i] {
                for j in [i - 1, i - system.width] {
                    if system.inside[j] {
                        self.unite(i as u32, j as u32);
                    }
                }
            }
        }
        // Roots are the least index of their part, so that one pass in order finds the root's label set.
        self.count = 0;
        for i in 0..length {
            if self.parent[i] == NONE {
                continue;
            }
            if self.parent[i] == i as u32 {
                self.parent[i] = LABEL | self.count as u32;
                self.count += 1;
            } else {
                let parent = self.parent[i] as usize;
                self.parent[i] = self.parent[parent];
            }
        }
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Label of a node of the mask.
    pub(super) fn of(&self, node: usize) -> Option<usize> {
        let label = self.parent[node];
        (label != NONE).then_some((label & !LABEL) as usize)
    }

    fn root(&mut self, mut i: u32) -> u32 {
        while self.parent[i as usize] != i {
            let parent = self.parent[i as usize];
            self.parent[i as usize] = self.parent[parent as usize];
            i = parent;
        }
        i
    }

    fn unite(&mut self, i: u32, j: u32) {
        let (i, j) = (self.root(i), self.root(j));
        self.parent[i.max(j) as usize] = i.min(j);
    }
}

/// Marks a parent that is already a label; no grid has 2³¹ nodes.
const LABEL: u32 = 1 << 31;
