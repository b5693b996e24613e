//! One self-contained HTML page with SVG figures for a fit, a diagnosis, or a proof.
