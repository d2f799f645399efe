//! Names of the interfaces of a section: what they state, and what is made up for those that state none.
#![forbid(unsafe_code)]

use std::collections::HashSet;

type Name = Vec<u8>;

/// No two interfaces share a name by accident, wherever in the section they are described.
#[derive(Default)]
pub struct Names {
    stated: HashSet<Name>,
    made_up: HashSet<Name>,
}

impl Names {
    /// Takes the name that an interface states.
    pub fn state(&mut self, name: &[u8]) {
        self.stated.insert(name.to_vec());
    }

    /// What to call the interface `index` from its first frame on. Without a stated name (empty) it is `can<index>` if no
    /// interface so far has that. Otherwise it is `interface<index>`, also where the stated name was made up for another
    /// interface that had frames before this one was described.
    pub fn choose(&mut self, stated: &[u8], index: usize) -> Name {
        if !stated.is_empty() && !self.made_up.contains(stated) {
            return stated.to_vec();
        }
        let usual = format!("can{index}").into_bytes();
        let mut name = if stated.is_empty() && self.is_free(&usual) {
            usual
        } else {
            format!("interface{index}").into_bytes()
        };
        while !self.is_free(&name) {
            name.push(b'_');
        }
        self.made_up.insert(name.clone());
        name
    }

    fn is_free(&self, name: &[u8]) -> bool {
        !self.stated.contains(name) && !self.made_up.contains(name)
    }
}
