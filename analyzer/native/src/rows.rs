//! Rows of views as text: templates that are compiled from profiles, filled in from the tables of a batch.
//!
//! Nothing here knows a word of a view: keys, names and units are in the templates. [`column`] reads the tables,
//! [`number`], [`spec`], [`show`] and [`text`] write single values, [`sheet::node`] is the language of the templates, and
//! [`sheet`] joins transfers with what they carry.

#![forbid(unsafe_code)]

pub mod column;
pub mod layout;
pub mod number;
pub mod sheet;
pub mod show;
pub mod spec;
pub mod text;
