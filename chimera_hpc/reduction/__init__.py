"""From a store to what people read: classes, results.json, analyses, tables, exports."""
