"""Reference values: how they are made (two roads each), kept, checked and read.

`entries` says what an entry is; `places` where the questions are put; `local_roads`, `motion_roads`, `cycle_roads` and
`rotation_roads` answer them; `kinds` lists what there is; `generation`, `manifest` and `checking` make and check files;
`store` reads them, `lookup` finds one; `draws` and `fresh` make new ones.
"""
