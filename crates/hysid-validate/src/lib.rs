//! Judging a model's output: error measures with a named normaliser, residual tests, loop area, error by branch, baselines.
