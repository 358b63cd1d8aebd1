# The service (docs/install.md#container). Only the second stage is the image: it has neither the
# sources nor what built them.
FROM python:3.12-slim-bookworm AS build
WORKDIR /source
COPY constraints.txt pyproject.toml setup.py README.md LICENSE ./
COPY gpsfsm gpsfsm
COPY analysis analysis
COPY grammars grammars
COPY runners runners
RUN python -m venv /opt/gpsfsm \
    && /opt/gpsfsm/bin/pip install --no-cache-dir --disable-pip-version-check \
       -c constraints.txt '.[serve,mcap]' \
    && /opt/gpsfsm/bin/python -m compileall -q /opt/gpsfsm/lib \
    && /opt/gpsfsm/bin/pip uninstall --yes --quiet pip

FROM python:3.12-slim-bookworm
LABEL org.opencontainers.image.title="gpsfsm" \
      org.opencontainers.image.description="Formal checks for robot plans that language models write" \
      org.opencontainers.image.licenses="Apache-2.0" \
      org.opencontainers.image.source="https://github.com/OWNER/gpsfsm" \
      org.opencontainers.image.documentation="https://owner.github.io/gpsfsm"
ENV PATH=/opt/gpsfsm/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    HOME=/data
RUN install -d -o 10001 -g 10001 /data
COPY --from=build /opt/gpsfsm /opt/gpsfsm
# A number, so that an orchestrator can see that it is not root.
USER 10001:10001
WORKDIR /data
VOLUME /data
EXPOSE 8321
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=30s --timeout=5s --start-period=30s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8321/livez', timeout=4)"]
ENTRYPOINT ["gpsfsm"]
# Without a token, in GPSFSM_TOKEN or by --token-file, it refuses to listen to other machines.
CMD ["serve", "--host", "0.0.0.0", "--journal", "/data/queue.db"]
