"""Data sets: splits, the manifest, clips of Gaussians; imports and exports of whole data sets."""
