// The maps of the worlds that a run can begin in; each is asked for once.

// knownWorlds(client, service, trouble) -> {geometry}: a map, or null where there is none
export function knownWorlds(client, service, trouble) {
  const found = new Map();
  return {
    async geometry(name) {
      const world = service.worlds.find((each) => each.world === name);
      if (!world || !world.simulated) return null;
      if (!found.has(name)) {
        try {
          found.set(name, await client.get(`/v1/worlds/${encodeURIComponent(name)}`));
        } catch (error) {
          trouble(`The map of ${name} cannot be shown: ${error.message}.`);
          return null;
        }
      }
      return found.get(name);
    },
  };
}
