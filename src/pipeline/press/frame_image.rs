//! The images of a press: lent by the caller, or read whenever they are needed.
use crate::pipeline::error::PipelineError;
use crate::pipeline::same_image::is_same_image;
use ndarray::{Array2, ArrayView1, ArrayView2, CowArray, Ix2};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

/// Reads an image again; the error is a sentence.
pub(super) type Read = Arc<dyn Fn() -> Result<Array2<u8>, String> + Send + Sync>;

#[derive(Clone)]
pub(super) enum FrameImage<'a> {
    Lent(ArrayView2<'a, u8>),
    OnDemand {
        read: Read,
        /// A hash of all its pixels and its size.
        hash: u64,
    },
}

impl<'a> FrameImage<'a> {
    pub(super) fn on_demand(image: ArrayView2<'_, u8>, read: Read) -> Self {
        Self::OnDemand {
            read,
            hash: hash_of_all(image),
        }
    }

    /// The image of the frame with this number.
    pub(super) fn get(&self, frame: usize) -> Result<CowArray<'a, u8, Ix2>, PipelineError> {
        match self {
            Self::Lent(image) => Ok(CowArray::from(*image)),
            Self::OnDemand { read, .. } => match read() {
                Ok(image) => Ok(CowArray::from(image)),
                Err(reason) => Err(PipelineError::Unreadable { frame, reason }),
            },
        }
    }

    /// Whether the image is read whenever it is needed.
    pub(super) fn is_on_demand(&self) -> bool {
        matches!(self, Self::OnDemand { .. })
    }

    /// Whether this is the same image, bit for bit. Of one that is read on demand the hash decides: that two images of
    /// thousands share one by chance has a probability below 1e-10.
    pub(super) fn equals(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Lent(one), Self::Lent(other)) => is_same_image(*one, *other),
            (Self::OnDemand { hash: one, .. }, Self::OnDemand { hash: other, .. }) => one == other,
            (Self::Lent(image), Self::OnDemand { hash, .. })
            | (Self::OnDemand { hash, .. }, Self::Lent(image)) => *hash == hash_of_all(*image),
        }
    }
}

/// Rows that a fingerprint looks at.
const FINGERPRINTED: usize = 8;

/// A hash of a few rows: the same for equal images, another for nearly all others, so that a frame is compared with few.
pub(super) fn fingerprint(image: ArrayView2<'_, u8>) -> u64 {
    hash(
        image,
        image
            .rows()
            .into_iter()
            .step_by(image.nrows() / FINGERPRINTED + 1),
    )
}

fn hash_of_all(image: ArrayView2<'_, u8>) -> u64 {
    hash(image, image.rows().into_iter())
}

fn hash<'a>(image: ArrayView2<'_, u8>, rows: impl Iterator<Item = ArrayView1<'a, u8>>) -> u64 {
    let mut hasher = DefaultHasher::new();
    image.dim().hash(&mut hasher);
    for row in rows {
        match row.as_slice() {
            Some(pixels) => hasher.write(pixels),
            None => row.iter().for_each(|pixel| hasher.write_u8(*pixel)),
        }
    }
    hasher.finish()
}
