//! How the messages of a channel are laid out.
#![forbid(unsafe_code)]

use super::protobuf::{self, Form};
use super::role::Role;
use super::{json, tree::Tree};

/// The messages of ROS packages that carry a CAN frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `can_msgs/Frame`: classic frames.
    CanMsgs,
    /// `ros2_socketcan_msgs/FdFrame`: frames of an interface in CAN FD mode, without remote frames.
    SocketCanFd,
    /// `ros2_socketcan_msgs/Frame`: either, with a data field of 64 bytes.
    SocketCan,
}

impl Kind {
    pub fn named(name: &str) -> Option<Kind> {
        match name {
            "can_msgs/Frame" => Some(Kind::CanMsgs),
            "ros2_socketcan/FdFrame" => Some(Kind::SocketCanFd),
            "ros2_socketcan/Frame" => Some(Kind::SocketCan),
            _ => None,
        }
    }
}

/// How ROS writes a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wire {
    /// ROS 2: fields aligned to their size, behind 4 bytes that state the byte order.
    Cdr,
    /// ROS 1: packed, little endian.
    Ros1,
}

/// Where the fields of a frame stand in a message.
#[derive(Debug)]
pub struct Layout(pub(super) Read);

#[derive(Debug)]
pub(super) enum Read {
    Ros(Wire, Kind),
    /// Log messages of ROS 2.
    Comments,
    /// Frames of `can_msgs` whose data is a number of frames.
    Drops,
    Json(json::Fields),
    /// With the roles whose absence says zero.
    Protobuf(protobuf::Fields, Vec<Role>),
}

impl Layout {
    pub fn ros(wire: Wire, kind: Kind) -> Layout {
        Layout(Read::Ros(wire, kind))
    }

    /// Comments, as our own writer writes them.
    pub fn comments() -> Layout {
        Layout(Read::Comments)
    }

    /// Drop counts, as our own writer writes them.
    pub fn drops() -> Layout {
        Layout(Read::Drops)
    }

    /// Whether a field has this role.
    pub(super) fn has(&self, role: Role) -> bool {
        match &self.0 {
            Read::Ros(..) | Read::Comments | Read::Drops => false,
            Read::Json(fields) => fields.leaves().any(|leaf| leaf == role),
            Read::Protobuf(fields, _) => fields.leaves().any(|(leaf, _)| leaf == role),
        }
    }

    /// Of each field its role and the keys that lead to it.
    ///
    /// # Errors
    /// Why these fields make no frame.
    pub fn json(fields: Vec<(Role, Vec<String>)>) -> Result<Layout, &'static str> {
        check(fields.iter().map(|(role, _)| *role))?;
        let mut tree = Tree::new();
        for (role, path) in fields {
            tree.add(path.into_iter().map(String::into_bytes).collect(), role)?;
        }
        Ok(Layout(Read::Json(tree)))
    }

    /// Of each field its role, the field numbers that lead to it, and how it is written.
    ///
    /// # Errors
    /// Why these fields make no frame.
    pub fn protobuf(fields: Vec<(Role, Vec<u32>, Form)>) -> Result<Layout, &'static str> {
        check(fields.iter().map(|(role, ..)| *role))?;
        let (mut tree, mut defaults) = (Tree::new(), vec![]);
        for (role, path, form) in fields {
            if form == Form::Repeated && role != Role::Data {
                return Err("only data can be repeated");
            }
            if protobuf::has_default(role, form) {
                defaults.push(role);
            }
            tree.add(path, (role, form))?;
        }
        Ok(Layout(Read::Protobuf(tree, defaults)))
    }
}

fn check(roles: impl Iterator<Item = Role>) -> Result<(), &'static str> {
    let mut seen: Vec<Role> = vec![];
    for role in roles {
        if seen
            .iter()
            .any(|&other| role == other || (role.is_data() && other.is_data()) || (role.is_id() && other.is_id()))
        {
            return Err("two fields have the same role");
        }
        seen.push(role);
    }
    if seen.iter().any(|role| role.is_id()) {
        Ok(())
    } else {
        Err("no field is the identifier")
    }
}
