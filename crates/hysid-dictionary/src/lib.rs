//! Regressors: lags, factors, terms as text, the dictionary of candidates and their one evaluator.
