"""One module per engine; each defines ``KIND``. What is heavy is imported when it is used."""
