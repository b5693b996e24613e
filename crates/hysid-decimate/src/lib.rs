//! The paper's sampling-rate reduction: decimators, MRD, MRE, the admissible factors, a recommendation.
