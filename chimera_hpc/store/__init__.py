"""The store of a sweep, in Zarr v3: schema, ledger, claims; written, read, checked, merged."""
