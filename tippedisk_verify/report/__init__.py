"""What the main job writes, from findings to pages.

`work` carries out claims and figures, on cores and with what was kept from before; `results` gathers them into one JSON
object; `pages` writes that object as HTML and as Markdown: every number on them is in results.json.
"""
