//! Where in a message the fields stand: a tree of keys, so that each message is read in one pass.
#![forbid(unsafe_code)]

/// Nested objects or messages on the way to a field.
pub const MAX_PATH: usize = 16;

/// What stands behind a key.
#[derive(Clone, Copy, Debug)]
pub(super) enum Target<L> {
    Leaf(L),
    /// A node of the tree.
    Inner(usize),
}

/// Node 0 is the message itself.
#[derive(Debug)]
pub(super) struct Tree<K, L>(Vec<Vec<(K, Target<L>)>>);

impl<K: PartialEq, L: Copy> Tree<K, L> {
    pub fn new() -> Self {
        Tree(vec![vec![]])
    }

    /// # Errors
    /// That the path is empty, too long, or that another one ends on it.
    pub fn add(&mut self, path: Vec<K>, leaf: L) -> Result<(), &'static str> {
        if path.is_empty() || path.len() > MAX_PATH {
            return Err("a path has 1 to 16 steps");
        }
        let (mut node, last) = (0, path.len() - 1);
        for (step, key) in path.into_iter().enumerate() {
            let found = self.0[node].iter().find(|(known, _)| *known == key);
            node = match found {
                Some((_, Target::Inner(inner))) if step < last => *inner,
                Some(_) => return Err("one path is the start of another"),
                None if step == last => {
                    self.0[node].push((key, Target::Leaf(leaf)));
                    break;
                }
                None => {
                    let inner = self.0.len();
                    self.0.push(vec![]);
                    self.0[node].push((key, Target::Inner(inner)));
                    inner
                }
            };
        }
        Ok(())
    }

    pub fn leaves(&self) -> impl Iterator<Item = L> + '_ {
        self.0.iter().flatten().filter_map(|&(_, target)| match target {
            Target::Leaf(leaf) => Some(leaf),
            Target::Inner(_) => None,
        })
    }

    #[inline]
    pub fn find(&self, node: usize, is: impl Fn(&K) -> bool) -> Option<Target<L>> {
        self.0[node].iter().find(|(key, _)| is(key)).map(|&(_, target)| target)
    }
}
