//! A hash of whole numbers that is the same on every machine and in every version.

/// The next number of a sequence without a pattern (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
pub fn mixed(state: u64) -> u64 {
    let mut z = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::mixed;

    /// The first numbers of the generator that begins at 0, as the reference implementation (Vigna's splitmix64.c) gives them.
    #[test]
    fn the_sequence_is_that_of_the_reference() {
        let step = 0x9e37_79b9_7f4a_7c15_u64;
        let numbers = [0, step, step.wrapping_mul(2)].map(mixed);
        assert_eq!(numbers, [0xe220_a839_7b1d_cdaf, 0x6e78_9e6a_a1b9_65f4, 0x06c4_5d18_8009_454f]);
    }
}
