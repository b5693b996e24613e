//! Term selection on any matrix and target: orthogonal forward regression, error reduction ratio, PRESS, criteria and stop reasons. Knows no signals.
