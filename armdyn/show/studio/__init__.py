"""The studio: a page in the browser on which start, goal, obstacles and load of an arm are changed by hand.

`state` is the edited state, `session` its consequences without a browser, `solving` the solver's process, `words`
the texts, `meshes` the arm's shapes as triangles, `origins` the server's address; `scene` and `page` draw all of it,
and only `page` imports viser.
"""
