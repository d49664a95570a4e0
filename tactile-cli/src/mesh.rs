//! Surfaces as meshes for other programs.
use ndarray::Array2;

/// A binary PLY of square pixels. Positions and depths are in millimetres, x along columns, y along
/// rows, and z the depth into the gel.
pub(crate) fn ply(depth_m: &Array2<f64>, pixel_size_m: f64) -> Vec<u8> {
    let (rows, columns) = depth_m.dim();
    let faces = rows.saturating_sub(1) * columns.saturating_sub(1);
    let mut file = format!(
        "ply\nformat binary_little_endian 1.0\ncomment unit mm, z is the depth into the gel\n\
         element vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {faces}\nproperty list uchar int vertex_indices\nend_header\n",
        rows * columns
    )
    .into_bytes();
    file.reserve(12 * rows * columns + 17 * faces);
    for ((row, column), z) in depth_m.indexed_iter() {
        let place = [column as f64 * pixel_size_m, row as f64 * pixel_size_m, *z];
        for v in place {
            file.extend(((1e3 * v) as f32).to_le_bytes());
        }
    }
    for row in 1..rows {
        for column in 1..columns {
            let at = |r: usize, c: usize| (r * columns + c) as i32;
            file.push(4);
            // Counterclockwise, seen from the object.
            let corners = [
                at(row - 1, column - 1),
                at(row - 1, column),
                at(row, column),
                at(row, column - 1),
            ];
            for corner in corners {
                file.extend(corner.to_le_bytes());
            }
        }
    }
    file
}
