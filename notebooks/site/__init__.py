"""The documentation as a site: `python -m notebooks.site --out DIR`, from the root of the repository.

Guides (`notebooks/guide/*.md`), pages of experiments (`experiments/*/README.md`), lessons (`notebooks/*.ipynb`), the
gallery that `experiments.gallery` drew (`notebooks/gallery`) and the reference that pdoc makes of docstrings. The build
is strict: a link that leads nowhere, a name that is none, a docstring that is missing, mathematics that is not LaTeX or
a warning of any kind fails it.
With `--release NAME` the site of a release is kept beside earlier ones, and each page lists them.
Needs `pip install -e '.[docs]'`.
"""
