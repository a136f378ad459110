"""The report of the main job.

- `tasks` examines claims and draws figures, on several cores, and reuses earlier results.
- `results_json` collects the results in one JSON object.
- `audit_pages` writes that object as HTML and as Markdown. Every number on the pages is in
results.json.
"""
