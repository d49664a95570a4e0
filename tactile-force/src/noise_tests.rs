use super::{Counts, respond};

/// An odd number of small and large responses.
#[test]
fn pairs_are_counted_like_single_responses() {
    let rows: [Vec<i16>; 2] = [
        (0..799).map(|k| k * 37 % 71).collect(),
        (0..33).map(|k| k * 127).collect(),
    ];
    let (mut counts, mut expected) = (Counts::new(), vec![0; 4081]);
    for responses in &rows {
        counts.add(responses);
        responses.iter().for_each(|&r| expected[r as usize] += 1);
    }
    assert_eq!(counts.histogram(), expected);
}

#[test]
fn responses_are_those_of_the_mask() {
    let lines = [[7, 250, 3, 90], [0, 255, 0, 255], [12, 13, 200, 1]].map(Vec::from);
    let mask = [1, -2, 1];
    let expected = [0, 1].map(|x: usize| {
        let terms = (0..9).map(|k| mask[k / 3] * mask[k % 3] * lines[k / 3][x + k % 3]);
        terms.sum::<i16>().abs()
    });
    let mut scratch = [vec![0; 4], vec![0; 4]];
    assert_eq!(respond(&lines, &mut scratch), expected);
}
