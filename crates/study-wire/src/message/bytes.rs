//! Fields as little-endian bytes.

use super::{FixedVec, WireError};
use crate::frame::MAX_BODY;
use core::num::NonZeroU16;

/// Code on the wire for a force without a sensor.
const NO_SENSOR: i32 = i32::MIN;

/// A value with a layout on the wire.
pub(super) trait Field: Sized {
    /// Its largest length in bytes.
    const MAX_LEN: usize;
    fn write(&self, out: &mut Writer);
    fn read(from: &mut Reader<'_>) -> Result<Self, WireError>;
}

/// Defines a message or a part of one. Its fields follow each other on the wire in
/// the order of the declaration; a field may name a condition on the values received.
macro_rules! fields {
    ($(#[$about:meta])* $name:ident {
        $($(#[$what:meta])* $field:ident: $type:ty $(, if $condition:ident)?;)+
    }) => {
        $(#[$about])*
        pub struct $name {
            $($(#[$what])* pub $field: $type,)+
        }

        impl crate::message::bytes::Field for $name {
            const MAX_LEN: usize = 0 $(+ <$type as crate::message::bytes::Field>::MAX_LEN)+;

            fn write(&self, out: &mut crate::message::bytes::Writer) {
                $(self.$field.write(out);)+
            }

            fn read(
                from: &mut crate::message::bytes::Reader<'_>,
            ) -> Result<Self, crate::message::WireError> {
                $(
                    let $field = <$type as crate::message::bytes::Field>::read(from)?;
                    $(if !$condition($field) {
                        return Err(crate::message::WireError::Field);
                    })?
                )+
                Ok(Self { $($field,)+ })
            }
        }
    };
}
pub(super) use fields;

/// Writes a body. Every message of version 1 fits; [`Writer::done`] reports an
/// overflow.
#[derive(Debug, Clone)]
pub(super) struct Writer {
    bytes: [u8; MAX_BODY],
    len: usize,
    overflow: bool,
}

impl Writer {
    pub(super) fn new() -> Self {
        Self {
            bytes: [0; MAX_BODY],
            len: 0,
            overflow: false,
        }
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        match self.bytes.get_mut(self.len..self.len + bytes.len()) {
            Some(free) => {
                free.copy_from_slice(bytes);
                self.len += bytes.len();
            }
            None => self.overflow = true,
        }
    }

    /// The body; `None` after an overflow.
    pub(super) fn done(&self) -> Option<&[u8]> {
        (!self.overflow).then(|| &self.bytes[..self.len])
    }
}

/// Reads the rest of a body.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], WireError> {
        let (first, rest) = self.0.split_first_chunk::<N>().ok_or(WireError::Length)?;
        self.0 = rest;
        Ok(*first)
    }

    /// Number of bytes left.
    pub(super) fn left(&self) -> usize {
        self.0.len()
    }

    /// Checks that nothing is left.
    pub(super) fn done(self) -> Result<(), WireError> {
        if self.0.is_empty() {
            Ok(())
        } else {
            Err(WireError::Length)
        }
    }
}

/// Numbers; a float may be NaN or infinite.
macro_rules! numbers {
    ($($type:ty)+) => {$(
        impl Field for $type {
            const MAX_LEN: usize = size_of::<$type>();

            fn write(&self, out: &mut Writer) {
                out.bytes(&self.to_le_bytes());
            }

            fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
                Ok(Self::from_le_bytes(from.array()?))
            }
        }
    )+};
}
numbers! { u8 u16 u32 i32 f64 }

impl Field for bool {
    const MAX_LEN: usize = 1;

    fn write(&self, out: &mut Writer) {
        u8::from(*self).write(out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        match u8::read(from)? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(WireError::Field),
        }
    }
}

/// A force, µN; `None` without a sensor.
impl Field for Option<i32> {
    const MAX_LEN: usize = i32::MAX_LEN;

    fn write(&self, out: &mut Writer) {
        self.unwrap_or(NO_SENSOR).write(out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let force_un = i32::read(from)?;
        Ok((force_un != NO_SENSOR).then_some(force_un))
    }
}

/// A number in which 0 stands for none.
impl Field for Option<NonZeroU16> {
    const MAX_LEN: usize = u16::MAX_LEN;

    fn write(&self, out: &mut Writer) {
        self.map_or(0, NonZeroU16::get).write(out);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        Ok(NonZeroU16::new(u16::read(from)?))
    }
}

impl<T: Field + Copy + Default, const N: usize> Field for [T; N] {
    const MAX_LEN: usize = N * T::MAX_LEN;

    fn write(&self, out: &mut Writer) {
        self.iter().for_each(|item| item.write(out));
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let mut items = [T::default(); N];
        for item in &mut items {
            *item = T::read(from)?;
        }
        Ok(items)
    }
}

/// From one to `N` items after their number.
impl<T: Field + Copy + Default, const N: usize> Field for FixedVec<T, N> {
    const MAX_LEN: usize = 1 + N * T::MAX_LEN;

    fn write(&self, out: &mut Writer) {
        // `N` is at most 56.
        (self.as_slice().len() as u8).write(out);
        self.as_slice().iter().for_each(|item| item.write(out));
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, WireError> {
        let count = usize::from(u8::read(from)?);
        if !(1..=N).contains(&count) {
            return Err(WireError::Field);
        }
        let mut list = Self::new();
        for _ in 0..count {
            list.push(T::read(from)?);
        }
        Ok(list)
    }
}
